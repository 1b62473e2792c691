from __future__ import annotations

import logging

import pytest

from mavproxy_uavapi.http.callers.log_throttle import EVERY, LogThrottle
from tests.support.api_port import Port
from tests.support.drone import Drone


def test_one_line_for_each_cause_and_minute_counts_those_left_out() -> None:
    now, lines = [0.0], list[str]()
    throttle = LogThrottle(lambda: now[0], lines.append)
    for _ in range(513):
        throttle.log("full", "no room")
    throttle.log("accept", "no descriptors")
    assert lines == ["no room", "no descriptors"]
    now[0] = EVERY
    throttle.log("full", "no room")
    assert lines[2:] == ["no room (and 512 more since the last such line)"]
    now[0] = 2 * EVERY
    throttle.log("full", "no room")
    assert lines[3:] == ["no room"]


def test_log_has_a_line_for_each_cause_whatever_a_stranger_sends(
    drone: Drone, port: Port, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    port.run(lambda: port.ask("GET", "/jobs", host="evil\x1b.example"))
    port.run(lambda: port.ask("GET", "/jobs", "Origin: http://evil\xff.example"))
    for _ in range(3):
        port.run(lambda: port.ask("GET", "/jobs"))
    lines = [record.getMessage() for record in caplog.records if "refused" in record.getMessage()]
    assert len(lines) == 2
    assert all(line.isascii() and line.isprintable() for line in lines)
