from __future__ import annotations

from mavproxy_uavapi.http.log_throttle import EVERY, LogThrottle


def test_one_line_for_each_cause_and_minute_with_the_number_of_those_left_out() -> None:
    now, lines = [0.0], list[str]()
    throttle = LogThrottle(lambda: now[0], lines.append)
    for _ in range(513):
        throttle.tell("full", "no room")
    throttle.tell("accept", "no descriptors")
    assert lines == ["no room", "no descriptors"]
    now[0] = EVERY
    throttle.tell("full", "no room")
    assert lines[2:] == ["no room (and 512 more since the last such line)"]
    now[0] = 2 * EVERY
    throttle.tell("full", "no room")
    assert lines[3:] == ["no room"]
