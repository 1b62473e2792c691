from __future__ import annotations

import pytest

from mavproxy_uavapi.core.airspace.fence_files import corners, is_list_of_points, rows
from mavproxy_uavapi.core.errors import BadRequest, Invalid

ROW = "0\t0\t0\t5001\t3.0\t0\t0\t0\t-35.1\t149.2\t0\t0"


def test_a_row_gives_its_command_its_first_parameter_and_its_place() -> None:
    assert rows(f"QGC WPL 110\n# by hand\n\n{ROW}\n") == [(0, 5001, 3.0, -35.1, 149.2)]


def test_home_of_mission_planner_is_no_item_a_later_waypoint_is_an_error() -> None:
    home = ROW.replace("5001", "16")
    assert rows(f"QGC WPL 110\n{home}\n1{ROW[1:]}") == [(1, 5001, 3.0, -35.1, 149.2)]
    with pytest.raises(Invalid, match="line 3 has the command 16"):
        rows(f"QGC WPL 110\n{home}\n1{home[1:]}")


def test_home_without_a_command_is_home_too() -> None:
    home = ROW.replace("5001", "0")
    assert rows(f"QGC WPL 110\n{home}\n1{ROW[1:]}") == [(1, 5001, 3.0, -35.1, 149.2)]


def test_older_file_gives_corners_without_return_point_and_repeated_one() -> None:
    text = "#saved by APM Planner\n0.5 0.5\n0 0\n0 1\n1 1\n0 0\n"
    assert is_list_of_points(text)
    assert corners(text) == [(0.0, 0.0), (0.0, 1.0), (1.0, 1.0)]


@pytest.mark.parametrize("text", ["", "# only a comment", '{"type": 1}', "QGC WPL 110\n", "RALLY 1 2", "lat,lon"])
def test_other_texts_are_no_list_of_points(text: str) -> None:
    assert not is_list_of_points(text)


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        ("0 0\n0 1\n1 1\n0 0", Invalid, "return point first"),
        ("9 9\n0 0\n0 1\n1 1\n1 0", Invalid, "the first one again last"),
        ("9 9\n0 0\n0 1\n0 0", Invalid, "return point first"),
        ("0 0\n0,5 1\n", BadRequest, "line 2 is not latitude and longitude with decimal points: '0,5 1'"),
        ("0 0\n0 1 2\n", BadRequest, "line 2 is not"),
    ],
)
def test_a_list_that_is_no_fence_is_refused(text: str, error: type[Exception], words: str) -> None:
    with pytest.raises(error) as caught:
        corners(text)
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("row", "error", "words"),
    [
        (ROW.replace("5001", "22"), Invalid, "line 2 has the command 22: a fence has 5000 to 5005"),
        (ROW.replace("0", "1", 1).replace("5001", "16"), Invalid, "line 2 has the command 16"),
        (ROW.replace("5001", "5001.5"), BadRequest, "its command is '5001.5', not a whole number"),
        (
            ROW.replace("-35.1", "-35,1"),
            BadRequest,
            "line 2: its latitude is '-35,1', not a number: numbers have dec",
        ),
        (ROW.replace("-35.1", "nan"), BadRequest, "line 2: its latitude is 'nan', not a number"),
        (ROW[:-2], BadRequest, "line 2 is not a row"),
    ],
)
def test_a_row_that_is_no_fence_is_refused(row: str, error: type[Exception], words: str) -> None:
    with pytest.raises(error) as caught:
        rows(f"QGC WPL 110\n{row}")
    assert words in str(caught.value)
