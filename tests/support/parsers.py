"""All parsers of foreign bytes: what each makes of them in a few words, and the errors that it may end in."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, TypeVar

from mavproxy_gradys.forwarding.confirmations import Confirmations
from mavproxy_gradys.nearby.advice import heard_in
from mavproxy_gradys.relay.positions import Positions
from mavproxy_gradys.tracks import formats as tracks
from mavproxy_uavapi.aerpaw import geofence, plans, safety_rules, safety_wire, wire
from mavproxy_uavapi.aerpaw.safety_server import read_rules
from mavproxy_uavapi.core.airspace import formats as envelopes
from mavproxy_uavapi.core.airspace.space import Space
from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_uavapi.core.file_text import text_of
from mavproxy_uavapi.core.ini_file import IniFile
from mavproxy_uavapi.core.link import parameter_files
from mavproxy_uavapi.core.mission import mission_files
from mavproxy_uavapi.core.strict_json import json_of
from mavproxy_uavapi.files import tokens
from mavproxy_uavapi.launcher.locations import read_locations
from mavproxy_vision.camera import calibration, calibration_files
from mavproxy_vision.camera.source import decode

T = TypeVar("T")
CORPUS = Path(__file__).parents[1] / "corpus"
WHAT = "the file"


class ForeignParser(NamedTuple):
    """A parser: its result in a few words, its errors, and the folder of the corpus with its files."""

    summary: Callable[[bytes], str]
    errors: tuple[type[Exception], ...]
    folder: str


def envelope(data: bytes) -> str:
    return Space(envelopes.of_bytes(data, "a file")).envelope.summary()


def mission(data: bytes) -> str:
    parts = mission_files.parts_of(text_of(data, WHAT))
    fence = "" if parts.fence is None else f"; fence: {parts.fence.summary()}"
    rally = f"; {len(parts.rally)} rally points" if parts.rally else ""
    return ", ".join(item.name for item in parts.items) + fence + rally


def parameters(data: bytes) -> str:
    values, left_out = parameter_files.read(text_of(data, WHAT))
    return f"{', '.join(f'{name} {value:g}' for name, value in values.items())}; left out: {', '.join(left_out)}"


def camera(data: bytes) -> str:
    model = calibration_files.read(text_of(data, WHAT))
    why_not = calibration.why_invalid(model)
    return why_not or f"{model.width}x{model.height}, {model.fx:g}, {len(model.distortion)} coefficients"


def track(data: bytes) -> str:
    return f"{len(tracks.waypoints_of(text_of(data, WHAT)))} waypoints"


def token_file(data: bytes) -> str:
    return ", ".join(f"{token.name} {token.rights}" for token in tokens.parse(text_of(data, WHAT)))


def ini(data: bytes) -> str:
    return ", ".join(f"[{name}] {len(keys)}" for name, keys in _of_file(data, IniFile).sections.items())


def json_body(data: bytes) -> str:
    return type(json_of(text_of(data, WHAT), WHAT)).__name__


def locations(data: bytes) -> str:
    return ", ".join(read_locations(data.decode(errors="replace").splitlines()))


def heard_position(data: bytes) -> str:
    heard = heard_in(data)
    return "" if heard is None else heard.device


def relayed_position(data: bytes) -> str:
    positions, measured = Positions(), re.search(rb'"time": ([\d.]+)', data)
    now = float(measured[1]) if measured else 0.0
    positions.put(data, now)
    return str([positions.form(one) for one in positions.take_changed(now)])


def confirmation(data: bytes) -> str:
    confirmations = Confirmations()
    confirmations.expect({1, 2})
    confirmations.take(data)
    return str(sorted(confirmations.collect({1, 2})))


def aerpaw_fence(data: bytes) -> str:
    return f"{len(_of_file(data, lambda file: geofence.read_geofence(str(file))))} corners"


def aerpaw_plan(data: bytes) -> str:
    return f"{len(_of_file(data, lambda file: plans.read_from_plan(str(file))))} waypoints"


def aerpaw_rules(data: bytes) -> str:
    rules: safety_rules.SafetyRules = _of_file(data, read_rules)
    return rules.vehicle_type


def aerpaw_request(data: bytes) -> str:
    return ", ".join(safety_wire.deserialize_msg(data))


def aerpaw_message(data: bytes) -> str:
    return ", ".join(map(str, wire.read(data, "none")))


def image(data: bytes) -> str:
    height, width = decode(data).shape[:2]
    return f"{width}x{height}"


def _of_file(data: bytes, read: Callable[[Path], T]) -> T:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "file")
        file.write_bytes(data)
        return read(file)


OURS = (UavApiError,)
PARSERS = {
    "envelope": ForeignParser(envelope, OURS, "envelopes"),
    "mission": ForeignParser(mission, OURS, "missions"),
    "parameters": ForeignParser(parameters, OURS, "parameters"),
    "calibration": ForeignParser(camera, OURS, "calibrations"),
    "track": ForeignParser(track, OURS, "tracks"),
    "tokens": ForeignParser(token_file, OURS, "tokens"),
    "ini": ForeignParser(ini, OURS, "ini"),
    "json": ForeignParser(json_body, OURS, "missions"),
    "locations": ForeignParser(locations, (), "parameters"),
    "heard position": ForeignParser(heard_position, (), "readings"),
    "relayed position": ForeignParser(relayed_position, (ValueError,), "readings"),
    "confirmation": ForeignParser(confirmation, (), "readings"),
    "AERPAW's fence": ForeignParser(aerpaw_fence, (ValueError,), "envelopes"),
    "AERPAW's plan": ForeignParser(aerpaw_plan, (ValueError,), "missions"),
    "AERPAW's rules": ForeignParser(aerpaw_rules, (ValueError, OSError), "calibrations"),
    "image": ForeignParser(image, OURS, "images"),
    "AERPAW's requests": ForeignParser(aerpaw_request, (ValueError,), "readings"),
    "AERPAW's messages": ForeignParser(aerpaw_message, (ValueError,), "readings"),
}
