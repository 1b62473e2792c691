from __future__ import annotations

from mavproxy_uavapi.rehearsal.page import as_html
from mavproxy_uavapi.rehearsal.record import Record
from mavproxy_uavapi.rehearsal.report import Rehearsed
from tests.support.rehearsed import asked, record, sample


def test_page_shows_the_way_and_what_was_asked_and_escapes_it() -> None:
    said = asked(1.0, "/command/arm", detail="<b>no</b>")
    page = as_html([Rehearsed(("reboot",), record(sample(0.0), sample(1.0, 30.0, 10.0), commands=(said,)), ())])
    assert "0 to 0 m east, 0 to 30 m north" in page and "0 to 1 s, 0 to 10 m above home" in page
    assert "&lt;b&gt;no&lt;/b&gt;" in page and "<b>no" not in page
    assert "http" not in page  # it needs nothing from elsewhere


def test_page_of_a_flight_that_never_was_says_so() -> None:
    assert "Nothing flew." in as_html([Rehearsed((), Record("a.py"), ())])
