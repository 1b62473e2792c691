"""Rally points as MAVProxy's `rally save` and Mission Planner write them."""

from __future__ import annotations

import pytest

from mavproxy_uavapi.core.errors import BadRequest, Invalid
from mavproxy_uavapi.core.mission.mission_files import rally_of

HOME = "0\t1\t0\t16\t0\t0\t0\t0\t-35.363\t149.165\t584.09\t1"
ROW = "{}\t0\t{}\t5100\t0\t0\t0\t0\t-35.3625\t149.1665\t30\t1"
LINE = "RALLY -35.362500\t149.166500\t30.000000\t40.000000\t0.000000\t0"
RELATIVE, AMSL = 3, 0


@pytest.mark.parametrize(
    ("text", "frames"),
    [
        (f"QGC WPL 110\n{ROW.format(0, RELATIVE)}\n{ROW.format(1, AMSL)}\n", [RELATIVE, AMSL]),
        (f"\ufeffQGC WPL 110\n{HOME}\n{ROW.format(1, RELATIVE)}\n", [RELATIVE]),
        (f"#NOTE: saved by hand\n\n{LINE}\n{LINE}\n", [RELATIVE, RELATIVE]),
    ],
)
def test_rows_are_points_with_the_heights_of_their_frames(text: str, frames: list[int]) -> None:
    items = rally_of(text)
    assert [item.frame for item in items] == frames
    assert {(item.name, item.x, item.y, item.z) for item in items} == {
        ("NAV_RALLY_POINT", -353625000, 1491665000, 30)
    }


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        (f"QGC WPL 110\n{HOME}\n", Invalid, "there is no rally point in it"),
        (f"QGC WPL 110\n{HOME}\n{HOME}\n", Invalid, "line 3 has the command 16: a rally point has 5100"),
        (
            f"QGC WPL 110\n{ROW.format(0, RELATIVE).replace('-35', '-95')}",
            Invalid,
            "latitude -95.3625 is not between",
        ),
        (f"{LINE}\n{LINE.replace('-35.3', '-35,3')}", BadRequest, "line 2 is not RALLY and six numbers with decimal"),
        (LINE.replace("30.000000", "nan"), BadRequest, "line 1 is not RALLY and six numbers"),
        (f"{LINE}\n149.1 -35.2 30", BadRequest, "line 2 is not RALLY and six numbers"),
        (f"{LINE[:-1]}2", Invalid, "line 1: its flags are 2, which no autopilot takes any more: write 0"),
        ("-35.3 149.1\n", BadRequest, "rally points are {"),
    ],
)
def test_what_is_no_rally_point_is_refused(text: str, error: type[Exception], words: str) -> None:
    with pytest.raises(error) as caught:
        rally_of(text)
    assert words in str(caught.value)
