from __future__ import annotations

import pytest

from mavproxy_uavapi.core.errors import BadRequest
from mavproxy_uavapi.core.mission.wpl import rows

ROW = "0\t1\t0\t16\t1\t2\t3\t4\t-35.363\t149.165\t584\t1"
COLUMNS = (0, 1, 0, 16, 1, 2, 3, 4, -35.363, 149.165, 584, 1)


def test_a_row_has_its_line_its_number_and_its_command() -> None:
    (row,) = rows(f"QGC WPL 110\n# by hand\n\n{ROW}\n")
    assert row == (4, COLUMNS)
    assert (row.number, row.command) == (0, 16)


@pytest.mark.parametrize(
    ("number", "command", "is_home"), [(0, 16, True), (0, 0, True), (0, 22, False), (1, 16, False)]
)
def test_home_has_number_0_and_is_a_waypoint_or_has_no_command(number: int, command: int, is_home: bool) -> None:
    (row,) = rows("QGC WPL 110\n" + ROW.replace("0\t1\t0\t16", f"{number}\t1\t0\t{command}", 1))
    assert row.is_home is is_home


def test_a_parameter_that_is_left_to_the_autopilot_is_0_a_place_never() -> None:
    (row,) = rows("QGC WPL 110\n" + ROW.replace("4\t-35", "nan\t-35"))
    assert row.columns[7] == 0.0
    for place in ("-35.363", "149.165", "584"):
        with pytest.raises(BadRequest, match="is 'nan', not a number"):
            rows("QGC WPL 110\n" + ROW.replace(place, "nan"))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("QGC WPL 120\n", "this is not a QGC WPL 110 file: it begins with 'QGC WPL 120'"),
        ("QGC WPL 110\n" + ROW[:-2], "line 2 is not a row of 12 columns (number, current,"),
        (
            "QGC WPL 110\n" + ROW.replace("149.165", "149,165"),
            "its longitude is '149,165', not a number: numbers have",
        ),
        ("QGC WPL 110\n" + ROW.replace("16", "16.5", 1), "its command is '16.5', not a whole number"),
    ],
)
def test_what_is_no_row_is_refused_by_its_line(text: str, words: str) -> None:
    with pytest.raises(BadRequest) as caught:
        rows(text)
    assert words in str(caught.value)
