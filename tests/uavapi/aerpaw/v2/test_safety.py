"""The safety checker of v2, asked without blocking."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from mavproxy_uavapi.aerpaw.geometry import Coordinate
from mavproxy_uavapi.aerpaw.v2.safety import NoOpSafetyChecker, PreflightChecks, SafetyCheckerClient
from mavproxy_uavapi.aerpaw.v2.vehicle import MockVehicle

HERE = Coordinate(35, -78, 10)


def test_requests_are_asked_one_after_the_other(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("zmq")
    client, open_at_once = SafetyCheckerClient("127.0.0.1", 9), [0]
    asked = []

    def send(request: bytes) -> dict[str, Any]:
        open_at_once.append(open_at_once[-1] + 1)
        asked.append(request)
        open_at_once.append(open_at_once[-1] - 1)
        return {"result": len(asked) == 1, "message": str(len(asked))}

    monkeypatch.setattr(client._client, "send_request", send)

    async def ask() -> list[tuple[bool, str]]:
        return await asyncio.gather(
            client.check_server_status(),
            client.validate_waypoint(HERE, HERE),
            client.validate_takeoff(10, 35, -78),
            client.validate_landing(35, -78),
            client.validate_change_speed(5),
        )

    assert asyncio.run(ask()) == [(True, "1"), (False, "2"), (False, "3"), (False, "4"), (False, "5")]
    assert max(open_at_once) == 1
    client.close()


def test_silent_server_is_a_timeout() -> None:
    pytest.importorskip("zmq")
    client = SafetyCheckerClient("127.0.0.1", 9, timeout_s=0.05)
    with pytest.raises(TimeoutError, match="did not answer"):
        asyncio.run(client.check_server_status())
    client.close()


def test_stand_in_allows_everything() -> None:
    checker = NoOpSafetyChecker("a test")
    assert asyncio.run(checker.validate_waypoint(HERE, HERE)) == (True, "")


@pytest.mark.parametrize(("fix", "level", "passes"), [(3, 10, True), (2, 100, False), (6, 9, False)])
def test_preflight_checks_look_at_the_fix_and_the_battery(fix: int, level: int, passes: bool) -> None:
    mock = MockVehicle()
    mock._state.update_gps(fix, 9)
    mock._state.update_battery(12.0, 0.0, level)
    assert asyncio.run(PreflightChecks.run_all(mock)) is passes
