"""Calibration files -> camera models: our own JSON; YAML of ROS (camera_info) and of OpenCV (FileStorage). Pure."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import yaml

from mavproxy_uavapi.core.errors import BadRequest
from mavproxy_uavapi.core.strict_json import is_finite_number, json_of, shown
from mavproxy_uavapi.core.text import nearest
from mavproxy_uavapi.core.values import NUMBER
from mavproxy_vision.geometry.camera_model import CameraModel

LARGEST = 1e6  # largest number in a calibration
LARGEST_FILE = 64 * 1024  # bytes
OPENCV_HEAD = re.compile(r"\A%YAML[: ]1\.[0-9]")  # a directive that YAML itself does not know
# What programs call it, in lower case: the calibrators of ROS and OpenCV, a recorded camera_info, older samples.
WIDTH, HEIGHT = ("image_width", "width"), ("image_height", "height")
MATRIX = ("camera_matrix", "cameramatrix", "k")
DISTORTION = (
    "distortion_coefficients", "distortion_coeffs", "dist_coeffs", "dist_coeff", "distcoeffs", "distortion", "d",
)  # fmt: skip
MAY_DISTORT = re.compile("dist|coef|radial|tangential")  # a name that is perhaps meant as one of these
FORMS = "a calibration is JSON of `vision calibrate`, or YAML of ROS (ost.yaml) or OpenCV (.yml)"
LENSES = ("distortion_model", "camera_model")
KNOWN_LENSES = (
    "plumb_bob",
    "rational_polynomial",
    "pinhole",
)  # as OpenCV's own models of a lens, with 4 to 14 numbers
FISHEYE = "fisheye_model"  # of OpenCV's sample program: 1 for a model that has other coefficients


def read(text: str) -> CameraModel:
    """The camera model in a file's text; whether a camera can have it is not checked.

    Raises:
        BadRequest: it is no calibration; the error names the line or the member.
    """
    if text.lstrip().startswith("{"):
        return _of_json(json_of(text, "the calibration"))
    models = [_of_yaml(members) for members in _documents(text)]
    if any(model != models[0] for model in models):
        raise BadRequest("it has several calibrations, which differ: keep one of them")
    return models[0]


# -- JSON -----------------------------------------------------------------------------------------------------


def _of_json(values: Mapping[str, Any]) -> CameraModel:
    """One number per field, and a list of numbers for the distortion."""
    names = [field.name for field in fields(CameraModel)]
    for name in values:
        if name not in names:
            raise BadRequest(f"unknown: {shown(name)}; {nearest(name, names)}")
    missing = [name for name in names if name not in values and name != "distortion"]
    if missing:
        raise BadRequest(f"missing: {', '.join(missing)}")
    distortion = values.get("distortion", [])
    if not isinstance(distortion, list):
        raise BadRequest(f"distortion: {shown(distortion)} is not a list")
    numbers = {name: _number(name, values[name]) for name in names if name != "distortion"}
    return CameraModel(
        _whole("width", numbers.pop("width")),
        _whole("height", numbers.pop("height")),
        **numbers,
        distortion=tuple(_number("distortion", value) for value in distortion),
    )


def _number(name: str, value: Any) -> float:
    if not is_finite_number(value) or abs(value) > LARGEST:
        raise BadRequest(f"{name}: {shown(value)} is not a number up to {LARGEST:g}")
    return float(value)


def _whole(name: str, value: float) -> int:
    if not value.is_integer():
        raise BadRequest(f"{name}: {value:g} is not a whole number")
    return int(value)


# -- YAML -----------------------------------------------------------------------------------------------------


def _of_yaml(members: Mapping[str, yaml.Node]) -> CameraModel:
    for name in LENSES:
        lens = members.get(name)
        if lens is not None and _scalar(lens) not in KNOWN_LENSES:
            raise BadRequest(
                f"{_place(lens)} has the lens {shown(_scalar(lens))}; {', '.join(KNOWN_LENSES)} are known"
            )
    fisheye = members.get(FISHEYE)
    if fisheye is not None and _scalar(fisheye) != "0":
        raise BadRequest(f"{_place(fisheye)} is of a fisheye model, whose coefficients mean something else")
    width, height = (_whole(names[0], _numbers(members, names, 1)[0]) for names in (WIDTH, HEIGHT))
    matrix = _numbers(members, MATRIX, 9)
    if any(matrix[index] != expected for index, expected in ((1, 0.0), (3, 0.0), (6, 0.0), (7, 0.0), (8, 1.0))):
        raise BadRequest("its camera_matrix is not fx 0 cx, 0 fy cy, 0 0 1")
    return CameraModel(width, height, matrix[0], matrix[4], matrix[2], matrix[5], _distortion(members))


def _distortion(members: Mapping[str, yaml.Node]) -> tuple[float, ...]:
    """The coefficients; none where the file has none, under whatever name."""
    if any(name in members for name in DISTORTION):
        return tuple(_numbers(members, DISTORTION))
    for name, node in members.items():
        if name not in LENSES and MAY_DISTORT.search(name):
            raise BadRequest(f"{_place(node)} has {shown(name)}, which is not known: call it {DISTORTION[0]}")
    return ()


def _documents(text: str) -> list[dict[str, yaml.Node]]:
    """The members of each document: a recorded camera_info has one for each message, and an empty one at its end."""
    try:
        roots = list(yaml.compose_all(OPENCV_HEAD.sub("", text, count=1), Loader=yaml.SafeLoader))
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = "" if mark is None else f": line {mark.line + 1}, column {mark.column + 1}"
        raise BadRequest(f"it is neither JSON nor YAML{where}; {FORMS}") from error
    except (yaml.YAMLError, RecursionError) as error:
        why = "a character that no YAML has, or nested too deeply"
        raise BadRequest(f"it is neither JSON nor YAML: {why}; {FORMS}") from error
    documents = [_members(root) for root in roots if not isinstance(root, yaml.ScalarNode) or root.value]
    if not documents:
        raise BadRequest(f"it is empty; {FORMS}")
    return documents


def _members(root: yaml.Node) -> dict[str, yaml.Node]:
    """The members of a document, by their names in lower case."""
    if not isinstance(root, yaml.MappingNode):
        raise BadRequest(f"it is neither a JSON object nor a YAML mapping; {FORMS}")
    members: dict[str, yaml.Node] = {}
    for name, value in root.value:
        if members.setdefault(_scalar(name).lower(), value) is not value:
            raise BadRequest(f"{_place(name)} has the name {shown(_scalar(name))} a second time")
    return members


def _numbers(members: Mapping[str, yaml.Node], names: tuple[str, ...], count: int | None = None) -> list[float]:
    """The numbers of the first of the names that there is: one, a list, its rows, or a matrix with its `data`."""
    name = next((name for name in names if name in members), None)
    if name is None:
        raise BadRequest(f"missing: {names[0]}")
    node = members[name]
    if isinstance(node, yaml.MappingNode):
        node = next((value for key, value in node.value if _scalar(key) == "data"), node)
    rows = node.value if isinstance(node, yaml.SequenceNode) else [node]
    cells = [cell for row in rows for cell in (row.value if isinstance(row, yaml.SequenceNode) else [row])]
    if count is not None and len(cells) != count:
        raise BadRequest(f"{_place(node)}: {name} has {len(cells)} numbers, not {count}")
    return [_cell(name, cell) for cell in cells]


def _cell(name: str, cell: yaml.Node) -> float:
    text = _scalar(cell)
    if not re.fullmatch(NUMBER, text):
        raise BadRequest(f"{_place(cell)}: its {name} has {shown(text)}, not a number with a decimal point")
    return _number(name, float(text))


def _scalar(node: yaml.Node) -> str:
    """A word or a number as it is written; empty for a list or a mapping."""
    return str(node.value) if isinstance(node, yaml.ScalarNode) else ""


def _place(node: yaml.Node) -> str:
    return f"line {node.start_mark.line + 1}"
