"""Places, vectors, plans and fences."""

from __future__ import annotations

import json
import math
import pickle
from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.aerpaw.exceptions import AerpawlibError
from mavproxy_uavapi.aerpaw.geofence import do_intersect, inside, readGeofence
from mavproxy_uavapi.aerpaw.geometry import Coordinate, VectorNED
from mavproxy_uavapi.aerpaw.helpers import ThreadSafeValue, heading_difference, wait_for_value_change
from mavproxy_uavapi.aerpaw.log import LogLevel
from mavproxy_uavapi.aerpaw.plans import get_location_from_waypoint, read_from_plan, read_from_plan_complete
from tests.support.virtual_time import FastLoop

HERE = Coordinate(35.7274, -78.696, 10)


def near(v: VectorNED) -> tuple[float, float, float]:
    return round(v.north, 6), round(v.east, 6), round(v.down, 6)


def test_vectors_are_reckoned_with() -> None:
    assert near(VectorNED(1, 2, 3) + VectorNED(1, 1) - VectorNED(0, 0, 1)) == (2, 3, 2)
    assert near(-1 * VectorNED(1, 2) * 2) == (-2, -4, 0)
    assert near(VectorNED(1, 0, 0).cross_product(VectorNED(0, 1, 0))) == (0, 0, 1)
    assert (VectorNED(3, 4, 12).hypot(), VectorNED(3, 4, 12).hypot(ignore_down=True)) == (13, 5)
    assert near(VectorNED(0, 5).norm()) == (0, 1, 0) and near(VectorNED(0, 0).norm()) == (0, 0, 0)
    assert str(VectorNED(1.5, 2, 0)) == "(1.5,2,0)"


def test_vector_turns_counterclockwise_seen_from_above() -> None:
    assert near(VectorNED(0, 1).rotate_by_angle(90)) == (1, 0, 0)  # from east to north
    heading = 30  # what is ahead of a vehicle that points there
    ahead = VectorNED(1, 0).rotate_by_angle(-heading)
    assert math.degrees(math.atan2(ahead.east, ahead.north)) == pytest.approx(heading)


@pytest.mark.parametrize("wrong", [1, "north", HERE])
def test_vectors_take_vectors_only(wrong: Any) -> None:
    with pytest.raises(TypeError):
        VectorNED(1, 0) + wrong
    with pytest.raises(TypeError):
        HERE.distance(VectorNED(1, 0))  # type: ignore[arg-type]
    with pytest.raises(TypeError):
        VectorNED(1, 0) * VectorNED(1, 0)  # type: ignore[operator]


@pytest.mark.parametrize("by", [VectorNED(30, 0), VectorNED(-40, 25, -5), VectorNED(0, 500, 2)])
def test_place_moved_lies_where_it_was_moved_to(by: VectorNED) -> None:
    there = HERE + by
    assert near(there - HERE) == pytest.approx((by.north, by.east, by.down), abs=1e-4)  # type: ignore[arg-type]
    assert HERE.distance(there) == pytest.approx(by.hypot(), rel=1e-4)
    assert HERE.ground_distance(there) == pytest.approx(by.hypot(ignore_down=True), rel=1e-4)
    back = there - by
    assert isinstance(back, Coordinate) and back.distance(HERE) < 0.05


@pytest.mark.parametrize(
    ("to", "bearing"), [((1, 0), 0), ((0, 1), 90), ((1, 1), 45), ((0, -1), 270), ((-1, -1), 225)]
)
def test_bearing_is_a_compass_direction(to: tuple[int, int], bearing: float) -> None:
    assert HERE.bearing(HERE + 100 * VectorNED(*to)) == pytest.approx(bearing, abs=0.01)


def test_place_is_json_and_text() -> None:
    assert json.loads(HERE.to_json()) == json.loads(HERE.toJson()) == {"lat": 35.7274, "lon": -78.696, "alt": 10}
    assert str(HERE) == "(35.7274,-78.696,10)"


def test_places_are_pickled_by_the_name_that_peers_know() -> None:
    with pytest.raises(pickle.PicklingError, match=r"aerpawlib\.v1\.util\.geometry"):  # the host serves that name
        pickle.dumps(HERE)


def item(command: int, number: int, *parameters: float | None) -> dict[str, Any]:
    return {"type": "SimpleItem", "command": command, "doJumpId": number, "params": list(parameters)}


PLAN = {
    "fileType": "Plan",
    "mission": {
        "items": [
            item(22, 1, 15, 0, 0, None, 0, 0, 20),
            item(178, 2, 1, 7, -1, 0, 0, 0, 0),
            {
                "type": "ComplexItem",
                "TransectStyleComplexItem": {"Items": [item(16, 3, 2, 0, 0, None, 35.1, -78.2, 30)]},
            },
            item(530, 4, 0, 2, None),
            item(20, 5, 0, 0, 0, 0, 0, 0, 0),
        ]
    },
}


def test_plan_is_read_with_the_speed_in_force(tmp_path: Path) -> None:
    file = tmp_path / "a.plan"
    file.write_text(json.dumps(PLAN))
    assert read_from_plan(str(file), 5) == [(22, 0, 0, 20, 1, 5), (16, 35.1, -78.2, 30, 3, 7), (20, 0, 0, 0, 5, 7)]
    place = read_from_plan_complete(str(file))[1]
    assert place == {"id": 3, "command": 16, "pos": [35.1, -78.2, 30], "wait_for": 2, "speed": 7}
    assert get_location_from_waypoint(read_from_plan(str(file))[1]).lat == 35.1


@pytest.mark.parametrize("text", ['{"fileType": "Mission"}', "[]"])
def test_what_is_no_plan_is_refused(tmp_path: Path, text: str) -> None:
    file = tmp_path / "a.plan"
    file.write_text(text)
    with pytest.raises(ValueError, match="Wrong file type"):
        read_from_plan(str(file))


KML = """<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Document><Folder><Placemark><Polygon>
<outerBoundaryIs><LinearRing><coordinates>
  -78.70,35.72,0 -78.69,35.72,0 -78.69,35.73,0 -78.70,35.73,0 -78.70,35.72,0
</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark></Folder></Document></kml>"""


def test_fence_is_read_and_what_lies_in_it_known(tmp_path: Path) -> None:
    file = tmp_path / "a.kml"
    file.write_text(KML)
    fence = readGeofence(str(file))
    assert fence[0] == {"lon": -78.70, "lat": 35.72}
    assert inside(-78.695, 35.725, fence) and not inside(-78.685, 35.725, fence) and not inside(-78.695, 35.74, fence)


@pytest.mark.parametrize("text", ["<kml/>", "no KML"])
def test_file_without_a_polygon_is_refused(tmp_path: Path, text: str) -> None:
    file = tmp_path / "a.kml"
    file.write_text(text)
    with pytest.raises(ValueError, match=r"a\.kml"):
        readGeofence(str(file))


@pytest.mark.parametrize(
    ("segments", "meet"),
    [
        ((0, 0, 2, 2, 0, 2, 2, 0), True),
        ((0, 0, 1, 1, 2, 2, 3, 3), False),
        ((0, 0, 2, 0, 1, 0, 1, 5), True),
        ((0, 0, 2, 0, 0, 1, 2, 1), False),
    ],
)
def test_segments_that_meet(segments: tuple[float, ...], meet: bool) -> None:
    assert do_intersect(*segments) is meet


def test_headings_wrap_at_north() -> None:
    assert (heading_difference(359, 1), heading_difference(1, 359), heading_difference(90, 270)) == (2, 2, 180)


def test_value_of_several_threads() -> None:
    value = ThreadSafeValue(1)
    assert (value.compare_and_set(2, 3), value.get()) == (False, 1)
    assert (value.compare_and_set(1, 3), value.get()) == (True, 3)
    value.set(4)
    assert value.get() == 4


def test_change_of_a_value_is_awaited(loop: FastLoop) -> None:
    values = iter([1, 2, 3, 3])
    assert loop.run(wait_for_value_change(lambda: next(values), 3)) == 3
    with pytest.raises(TimeoutError, match="too slow"):
        loop.run(wait_for_value_change(lambda: 1, 3, timeout=0, timeout_message="too slow"))


def test_error_tells_its_cause_once() -> None:
    assert str(AerpawlibError("it failed", ValueError("no GPS"))) == "it failed (caused by: no GPS)"
    assert str(AerpawlibError("it failed: no GPS", ValueError("no GPS"))) == "it failed: no GPS"
    assert str(AerpawlibError("it failed")) == "it failed"


@pytest.mark.parametrize(("name", "level"), [("debug", "DEBUG"), ("warn", "WARNING")])
def test_level_is_found_by_its_name(name: str, level: str) -> None:
    assert LogLevel.from_string(name).name == level
