from __future__ import annotations

import json
from collections.abc import Callable

import pytest

from mavproxy_gradys import console
from mavproxy_gradys.net.round_trips import RoundTrips
from mavproxy_gradys.push.statistics import StationTally
from mavproxy_gradys.service import Gradys
from mavproxy_gradys.settings import GradysSettings
from mavproxy_uavapi.core.host import Host
from tests.gradys.conftest import TelemetrySource


@pytest.fixture
def gradys(host: Host, telemetry: TelemetrySource, settings: Callable[..., GradysSettings]) -> Gradys:
    """A service with one station, which has been told a few updates."""
    made = Gradys(host)
    made.settings = settings(gs="10.0.0.5:8000")
    tally = made.stations["http://10.0.0.5:8000"] = StationTally("http://10.0.0.5:8000", lambda: 0.0)
    vehicle = tally.vehicle(10)
    vehicle.sent = 3
    vehicle.answered(False, host.clock())
    vehicle.answered(True, host.clock())
    vehicle.refused("no answer within 3 s")
    tally.failed("no answer within 3 s", host.clock())
    tally.backoff.failed(host.clock())
    tally.round_trips.add(0.0123)
    tally.ip = "192.0.2.2:8000/"
    return made


def test_the_status_says_what_became_of_the_updates(gradys: Gradys) -> None:
    output = console.status(gradys.report())
    assert "3 sent, 2 acknowledged (1 of them dropped by the station: no browser watches), 1 failed" in output
    assert "round trip 12.3 ms" in output
    assert "our address for it: 192.0.2.2:8000/" in output
    assert "last error 0 s ago: no answer within 3 s" in output
    assert "next try in 1.0 s" in output
    assert "vehicle 10: next is 2, last one acknowledged 0.0 s ago" in output


def test_the_status_says_why_nothing_is_pushed(gradys: Gradys) -> None:
    gradys.stations["http://10.0.0.5:8000"].vehicle(10).withhold("vehicle 10 has no position fix")
    assert "nothing to send: vehicle 10 has no position fix" in console.status(gradys.report())


def test_the_table_has_a_row_for_each_vehicle(gradys: Gradys) -> None:
    head, row, *_ = console.stats(gradys.report()).splitlines()
    assert head.split() == ["station", "vehicle", "sent", "acked", "dropped", "failed", "withheld", "seq"]
    assert row.split() == ["http://10.0.0.5:8000", "10", "3", "2", "1", "1", "0", "2"]


def test_the_report_is_json_with_the_totals_in_front(gradys: Gradys) -> None:
    report = json.loads(json.dumps(gradys.report(), allow_nan=False))
    assert (report["sent"], report["acknowledged"], report["dropped_by_station"]) == (3, 2, 1)
    assert report["last_error"] == "no answer within 3 s"
    assert report["round_trip_ms"]["last"] == 12.3
    assert (report["spooled"], report["oldest_unsent_s"]) == (0, None)


def test_the_spools_troubles_are_reported() -> None:
    spool = {"file": "/x", "problem": "disk is full", "dropped": {"size": 3, "age": 0}, "set_aside": ["/x.corrupt-1"]}
    assert console.spool_lines(spool) == [
        "  kept in /x",
        "  NOT KEPT just now: disk is full",
        "  dropped: 3 by size",
        "  a corrupt file was set aside: /x.corrupt-1",
    ]


def test_readings_that_are_refused_alone_are_reported(gradys: Gradys) -> None:
    counts = dict.fromkeys(("batches", "sent", "acknowledged"), 3)
    sink = {
        "sink": "http://a",
        **counts,
        "put_last": 2,
        "last_error": None,
        "next_try_s": None,
        "round_trip_ms": None,
    }
    output = console.readings_lines({**gradys.report(), "sinks": [sink]})
    assert output[-1] == "  2 times one was refused alone: it is sent when there is nothing else"


def test_round_trips_are_of_the_last_hundred() -> None:
    trips = RoundTrips()
    assert trips.summary() is None
    for milliseconds in range(1000, 1101):
        trips.add(milliseconds / 1000)
    assert trips.summary() == {"last": 1100.0, "median": 1051.0, "p95": 1096.0, "max": 1100.0}
