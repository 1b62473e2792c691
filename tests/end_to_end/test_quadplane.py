"""A QuadPlane behind the API: the embedded one in lock step, ArduPilot's in a real MAVProxy."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.support.processes import Rig
from tests.support.sitl_types import ardupilot_type
from tests.support.wired_rig import WiredRig

pytestmark = pytest.mark.long

FIELD = (-35.363261, 149.165230)  # degrees, where it stands at the beginning
FIXED_WING, HOVERING = 4, 3  # MAV_VTOL_STATE


@pytest.fixture(scope="module", params=["lockstep", pytest.param("ardupilot", marks=pytest.mark.sitl)])
def quadplane(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    """A QuadPlane that the tests share; each test leaves it disarmed."""
    directory = tmp_path_factory.mktemp("quadplane")
    embedded = request.param == "lockstep"
    rig = WiredRig(directory, "quadplane") if embedded else ardupilot_type(directory, "quadplane")
    yield rig
    rig.stop()


def height(rig: Rig) -> float:
    return float(rig.ok(rig.get("/telemetry/gps"))["info"]["position"]["relative_alt"])


def hover(rig: Rig, alt: float = 20.0) -> None:
    rig.ok(rig.get("/command/arm", timeout=60))
    rig.ok(rig.get("/command/takeoff", alt=alt, vtol="true"))
    assert height(rig) == pytest.approx(alt, abs=10)


def has_landed(rig: Rig) -> None:
    rig.until(lambda: rig.status()["landed_state"] == "on_ground", 10, "the report that it has landed")
    assert rig.status()["armed"] is False


def test_it_climbs_vertically_flies_on_the_wing_circles_and_lands_where_it_is(quadplane: Rig) -> None:
    hover(quadplane)
    assert quadplane.status()["mode"] == "GUIDED"
    quadplane.ok(quadplane.post("/movement/go_to_gps_wait", lat=FIELD[0] + 0.004, long=FIELD[1], alt=60))
    assert height(quadplane) == pytest.approx(60, abs=15)
    assert quadplane.ok(quadplane.get("/movement/stop"))["result"] == "Plane is loitering"
    assert quadplane.status()["mode"] == "LOITER"
    assert quadplane.ok(quadplane.get("/command/land", timeout=240))["result"]
    assert quadplane.status()["mode"] == "QLAND"
    has_landed(quadplane)


def test_it_returns_on_the_wing_and_comes_down_on_its_lift_motors(quadplane: Rig) -> None:
    hover(quadplane)
    quadplane.ok(quadplane.post("/movement/go_to_gps_wait", lat=FIELD[0] - 0.004, long=FIELD[1], alt=60))
    assert quadplane.ok(quadplane.get("/command/rtl", timeout=240))["result"] == "Returned to launch"
    assert (quadplane.status()["mode"], quadplane.status()["armed"]) == ("RTL", True)
    landing = quadplane.ok(quadplane.get("/command/land_at", lat=FIELD[0], long=FIELD[1], vtol="true"))
    assert landing["result"].startswith("Landing mission started")
    quadplane.until(lambda: quadplane.status()["armed"] is False, 120, "landing and disarming")
    has_landed(quadplane)


def test_it_arms_after_a_landing_of_its_mission_and_takes_off_on_the_wing(quadplane: Rig) -> None:
    assert quadplane.ok(quadplane.get("/mission/waypoints"))["items"][0]["command"] == "NAV_VTOL_LAND"
    quadplane.ok(quadplane.get("/command/arm", timeout=60))
    quadplane.ok(quadplane.get("/command/takeoff", alt=40))
    assert height(quadplane) == pytest.approx(40, abs=15)
    quadplane.ok(quadplane.get("/command/land", timeout=240))
    has_landed(quadplane)
