"""Ten vehicles fly squares at once through one MAVProxy, and their positions go to a ground station meanwhile."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import requests

from mavproxy_uavapi.core.geodesy import offset
from tests.support.ground_station import Recorder
from tests.support.ports import free_port
from tests.support.processes import SCRIPTS, Rig, eventually
from tests.support.several_vehicles import listed
from tests.support.truth import Truth

FIRST, COUNT = 10, 10
SYSTEMS = range(FIRST, FIRST + COUNT)
SPACING, SIDE, ALT = 20.0, 10.0, 5.0  # m; the squares do not touch
CORNERS = [(SIDE, 0.0), (SIDE, SIDE), (0.0, SIDE), (0.0, 0.0)]
SPEEDUP, STREAM_RATE, PERIOD = 3, 2, 0.5  # STREAM_RATE: Hz of the vehicle's clock; PERIOD: s of ours
TOLERANCE = 1.5  # m; the vehicle tells its true place every half second of its own


@pytest.fixture
def station() -> Iterator[Recorder]:
    made = Recorder(free_port())
    yield made
    made.stop()


@pytest.fixture
def truth() -> Iterator[Truth]:
    made = Truth()
    yield made
    made.close()


@pytest.fixture
def rig(tmp_path: Path, station: Recorder, truth: Truth) -> Iterator[Rig]:
    """`mavproxy-uavapi --simulated --count 10` with gradys, without a prompt."""
    rig = Rig(tmp_path, free_port())
    push = {"gs": f"127.0.0.1:{station.server_port}", "period": PERIOD, "spool": str(tmp_path / "spool.db")}
    command = [sys.executable, str(SCRIPTS / "mavproxy-uavapi"), "--simulated", "--headless", f"--count={COUNT}"]
    command += [f"--sysid={FIRST}", f"--spacing={SPACING:g}", f"--speedup={SPEEDUP}", f"--port={rig.port}"]
    command += ["--gs_connection", truth.address, f"--log_path={tmp_path}"]
    command += ["--module", "gradys:" + json.dumps(push, separators=(",", ":")), "--", f"--streamrate={STREAM_RATE}"]
    try:
        rig.start("launcher", command).says(f"API of vehicles {FIRST} to {FIRST + COUNT - 1}", timeout=240)
        eventually(lambda: set(SYSTEMS) <= set(listed(rig)), what="all vehicles in the list")
        eventually(lambda: set(SYSTEMS) <= truth.systems, what="the true places of all vehicles")
        yield rig
    finally:
        rig.stop()


def fly_square(rig: Rig, system: int) -> None:
    """Take off and fly to each corner, by the vehicle's own paths."""
    url = f"{rig.url}/vehicles/{system}"
    with requests.Session() as client:
        rig.ok(client.get(f"{url}/command/arm", timeout=120))
        rig.ok(client.get(f"{url}/command/takeoff", params={"alt": ALT}, timeout=120))
        for x, y in CORNERS:
            rig.ok(client.post(f"{url}/movement/go_to_ned_wait", json={"x": x, "y": y, "z": -ALT}, timeout=120))


def nearest(path: list[tuple[float, float]], corner: tuple[float, float]) -> int:
    """The index of the place that is nearest to the corner."""
    return min(range(len(path)), key=lambda number: math.dist(path[number], corner))


@pytest.mark.long
def test_ten_vehicles_fly_squares_at_once_and_push_their_positions(rig: Rig, station: Recorder, truth: Truth) -> None:
    with ThreadPoolExecutor(COUNT) as pool:
        for flown in [pool.submit(fly_square, rig, system) for system in SYSTEMS]:
            flown.result()
    forms = list(station.forms)
    for system in SYSTEMS:
        path = truth.path(system)
        reached = [nearest(path, corner) for corner in CORNERS[:3]]
        assert reached == sorted(reached)
        for number, corner in zip(reached, CORNERS[:3], strict=True):
            assert path[number] == pytest.approx(corner, abs=TOLERANCE)
        assert path[-1] == pytest.approx(CORNERS[-1], abs=TOLERANCE)
        pushed = [
            offset(*truth.start_of(system), float(form["lat"]), float(form["lng"]))
            for form in forms
            if form["id"] == str(system) and float(form["alt"]) > ALT / 2
        ]
        assert all(-TOLERANCE < metres < SIDE + TOLERANCE for place in pushed for metres in place), (system, pushed)
        assert max(north for north, _ in pushed) > SIDE / 2 < max(east for _, east in pushed)
