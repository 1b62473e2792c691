"""The operator's envelope at the prompt of a real MAVProxy: a file that changes, and the fence that MAVProxy has."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import pytest

from tests.support.envelopes import field, place, square
from tests.support.processes import Rig, eventually

pytestmark = pytest.mark.long

OUT = {"x": 0, "y": 60, "z": -10}


@pytest.fixture
def flying(embedded_rig: Rig) -> Iterator[Rig]:
    """In the air, without an envelope before and after."""
    embedded_rig.in_the_air(10)
    yield embedded_rig
    embedded_rig.mavproxy.type("uavapi set envelope None")
    eventually(lambda: embedded_rig.ok(embedded_rig.get("/envelope"))["envelopes"] == [])


def refused(rig: Rig, **target: float) -> dict[str, Any]:
    answer = rig.post("/movement/go_to_ned", **target)
    assert (answer.status_code, answer.json()["code"]) == (409, "outside_envelope"), answer.text
    return dict(answer.json())


def heights(rig: Rig) -> list[float]:
    return [one["envelope"]["limits"].get("height") for one in rig.ok(rig.get("/envelope"))["envelopes"]]


def test_file_is_in_force_until_a_better_one_can_be_read(flying: Rig) -> None:
    file = flying.directory / "field.geojson"
    file.write_text(json.dumps(field(50, 300, height=40)))
    flying.mavproxy.type(f"uavapi set envelope {file}")
    eventually(lambda: heights(flying) == [40])
    assert refused(flying, **OUT)["outside"]["source"] == "field.geojson"
    flying.ok(flying.post("/movement/go_to_ned_wait", x=0, y=20, z=-10))
    mark = flying.mavproxy.mark()
    file.write_text("{")
    flying.mavproxy.says("the one before stays in force", mark)
    refused(flying, **OUT)
    file.write_text(json.dumps(field(50, 300, height=30)))
    eventually(lambda: heights(flying) == [30])
    mark = flying.mavproxy.mark()
    flying.mavproxy.ask("uavapi set envelope /nowhere/at/all", "cannot be read")
    refused(flying, **OUT)
    answer = flying.call("DELETE", "/envelope")
    assert answer.status_code == 404


def test_fence_that_mavproxy_has_loaded_is_the_envelope(flying: Rig) -> None:
    flying.mavproxy.type("uavapi set envelope vehicle")
    eventually(lambda: "fence list" in flying.post("/movement/go_to_ned", x=0, y=0, z=-10).text)
    flying.ok(flying.get("/command/brake"))
    flying.ok(flying.get("/command/guided"))
    corners = [place(0, 0), *(place(*corner) for corner in (*square(50), square(50)[0]))]
    fence = flying.directory / "fence.txt"
    fence.write_text("".join(f"{lat:.7f} {lon:.7f}\n" for lat, lon in corners))
    flying.mavproxy.type(f"fence load {fence}")
    eventually(lambda: [one["vehicle"] for one in flying.ok(flying.get("/envelope"))["envelopes"]] == [1])
    assert refused(flying, **OUT)["outside"]["what"].startswith("fence polygon")
    flying.ok(flying.post("/movement/go_to_ned_wait", x=0, y=-20, z=-10))
