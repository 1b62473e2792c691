"""docs/migrating.md and docs/centmesh.md: what their columns "here" and "today" name exists."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from pymavlink import mavutil

from mavproxy_gradys.http import GradysHandlers
from mavproxy_gradys.module import HELP as GRADYS_HELP
from mavproxy_gradys.settings import GradysModuleSettings
from mavproxy_uavapi import client
from mavproxy_uavapi.client.drone import Drone
from mavproxy_uavapi.http.routes import MESSAGE, ROUTES
from mavproxy_uavapi.settings import ApiModuleSettings
from mavproxy_vision.http import VisionHandlers

DOCS = Path(__file__).parents[2] / "docs"
PAGES = ("migrating.md", "centmesh.md")
OURS = re.compile(r"here|today")
SPAN = re.compile(r"`([^`]+)`")
PATH = re.compile(r"(?:(GET|POST|PUT|DELETE) )?(/(?:command|movement|telemetry|mission|vision|gradys)/[\w/{}-]+)")
OTHER_PATH = re.compile(r"(GET|POST|PUT|DELETE) (/[\w/{}-]+)")
CALL = re.compile(r"drone\.(\w+)(?:\((.*)\))?(?: \+ Ned\(.*\))?")
MAVLINK = re.compile(r"\b(?:MAV_(?:CMD|FRAME)_|NAV_)[A-Z_]+\b")
# Neither asks its module for anything until a request comes.
MODULES = [*GradysHandlers(None).routes(), *VisionHandlers(None, None).routes()]  # type: ignore[arg-type]
METHODS = {(method, route.path) for route in [*ROUTES, *MESSAGE, *MODULES] for method in route.methods}


def text_of(page: str) -> str:
    return (DOCS / page).read_text(encoding="utf-8")


def cells(page: str) -> Iterator[str]:
    """The cells of ours, of all tables."""
    ours: list[bool] = []
    for line in text_of(page).splitlines():
        columns = [cell.strip() for cell in line.strip("|").split("|")] if line.startswith("|") else []
        if not columns:
            ours = []
        elif not ours:
            ours = [bool(OURS.match(column)) for column in columns]
            assert any(ours), line
        else:
            assert len(columns) == len(ours), line
            yield from (cell for cell, is_ours in zip(columns, ours, strict=True) if is_ours)


def spans(page: str) -> list[str]:
    return [span for cell in cells(page) for span in SPAN.findall(cell)]


def why_wrong(span: str) -> str | None:
    """What a span names that does not exist; None where it names nothing, or all is there."""
    if match := PATH.fullmatch(span) or OTHER_PATH.fullmatch(span):
        methods = [match[1]] if match[1] else ["GET", "POST", "PUT", "DELETE"]
        return None if any((method, match[2]) in METHODS for method in methods) else "no such path"
    if match := CALL.fullmatch(span):
        return why_wrong_call(match[1], match[2])
    if match := re.match(r"gradys (\w+(?: (?:record|fly|stop))?)", span):
        return None if f"gradys {match[1]}" in GRADYS_HELP else "no such command"
    return None


def why_wrong_call(name: str, arguments: str | None) -> str | None:
    """Whether the client has this property, or a method that takes these arguments."""
    member = inspect.getattr_static(Drone, name, None)
    if member is None:
        return "no such member"
    if isinstance(member, property):
        return None if arguments is None else "it is a property"
    if arguments is None:
        return "it is a method"
    words = [word.strip() for word in arguments.split(",") if word.strip()]
    keywords = {word.partition("=")[0]: 1 for word in words if "=" in word}
    try:
        inspect.signature(member).bind(None, *[word for word in words if "=" not in word], **keywords)
    except TypeError as error:
        return str(error)
    return None


@pytest.mark.parametrize("page", PAGES)
def test_what_a_table_names_exists(page: str) -> None:
    named = spans(page)
    assert sum(bool(PATH.fullmatch(span)) for span in named) >= 3
    assert {span: wrong for span in named if (wrong := why_wrong(span))} == {}


@pytest.mark.parametrize(
    "span",
    [
        "POST /command/hover", "DELETE /command/arm", "GET /movement/go_to_gps", "/mission/nothing", "PUT /nothing",
        "drone.hover()", "drone.position()", "drone.land", "drone.takeoff()", "drone.go_to(position, speed=3)",
        "gradys fly x",
    ],
)  # fmt: skip
def test_what_does_not_exist_is_found_out(span: str) -> None:
    assert why_wrong(span)


@pytest.mark.parametrize("page", PAGES)
def test_constants_are_mavlinks(page: str) -> None:
    names = set(MAVLINK.findall(text_of(page)))
    missing = {
        name for name in names if not hasattr(mavutil.mavlink, name if name[:3] == "MAV" else f"MAV_CMD_{name}")
    }
    assert missing == set()


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_somewhere(page: str) -> None:
    links = re.findall(r"\]\(([^)#]+)(?:#([\w-]+))?\)", text_of(page))
    assert links
    for target, heading in links:
        file = DOCS / target
        assert file.exists(), target
        if heading:
            titles = re.findall(r"^#+ (.*)$", file.read_text(encoding="utf-8"), re.MULTILINE)
            assert heading in {title.lower().replace(" ", "-") for title in titles}, heading


def test_client_and_settings_have_the_names_of_the_text() -> None:
    assert {"connect", "Ned"} <= set(dir(client))
    assert {"token", "allow_from", "allow_scripts_from", "allow_raw", "max_age"} <= set(ApiModuleSettings.names())


def test_pymavlink_has_the_names_of_the_tutorial() -> None:
    names = (
        "set_mode",
        "set_mode_auto",
        "set_mode_rtl",
        "arducopter_arm",
        "motors_armed_wait",
        "recv_match",
        "write",
    )
    assert [name for name in names if not hasattr(mavutil.mavfile, name)] == []
    assert hasattr(mavutil, "mode_string_v10")
    assert hasattr(mavutil.mavlink.MAVLink, "mission_item_send")


def test_the_ini_lines_are_read(tmp_path: Path) -> None:
    (block,) = re.findall(r"^```ini\n(.*?)^```$", text_of("centmesh.md"), re.MULTILINE | re.DOTALL)
    ini = tmp_path / "uav.ini"
    ini.write_text(block)
    gps, soil, pressure = GradysModuleSettings({"config": str(ini)}).snapshot().quantities
    assert (gps.file, gps.period, gps.is_text) == ("/tmp/gps_data", 5.0, True)
    assert (soil.file, soil.representation) == ("/run/soil.txt", "percent")
    assert pressure.command == ("/opt/sensors/read-pressure", "--bus", "1")
