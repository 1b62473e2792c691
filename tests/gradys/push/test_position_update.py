from __future__ import annotations

import math
from typing import Any

import pytest

from mavproxy_gradys.errors import NoFix
from mavproxy_gradys.position import position_of
from mavproxy_gradys.push import position_update
from mavproxy_uavapi.core.errors import LinkLost, Stale
from mavproxy_uavapi.core.host import Host
from tests.gradys.conftest import TelemetrySource
from tests.support.messages import message_of
from tests.support.virtual_time import FastLoop

CAPTURED = (
    b"id=10&lat=-15.840081&lng=-47.926642&alt=20.123&ground_speed=1.25&air_speed=1.5&heading=270"
    b"&battery_percent=97&ready_to_arm=True&device=uav&type=102&seq=0&ip=192.0.2.2%3A8000%2F"
)


def where(telemetry: TelemetrySource, now: float, **changes: Any) -> position_update.VehiclePosition:
    limits = {"max_age": 5.0, "link_timeout": 5.0, "has_position": True, **changes}
    return position_of(telemetry.state, now, **limits)


def form(telemetry: TelemetrySource, now: float, **changes: Any) -> dict[str, str]:
    fields = {"seq": 0, "ip": "192.0.2.2:8000/", "ready": True, "max_age": 5.0, **changes}
    return position_update.form(telemetry.state, where(telemetry, now), now, **fields)


def test_the_bytes_are_those_of_the_original(telemetry: TelemetrySource, loop: FastLoop) -> None:
    assert position_update.encode(form(telemetry, loop.time())) == CAPTURED


def test_old_positions_are_not_reported(telemetry: TelemetrySource, loop: FastLoop) -> None:
    now = loop.time()
    assert where(telemetry, now + 4.9).age == pytest.approx(4.9)
    with pytest.raises(Stale, match="5.1 s old"):
        where(telemetry, now + 5.1, link_timeout=60.0)


def test_a_lost_link_is_reported_before_anything_else(telemetry: TelemetrySource, loop: FastLoop) -> None:
    with pytest.raises(LinkLost):
        where(telemetry, loop.time() + 5.0)


def test_a_vehicle_that_never_reported_its_position_has_none(host: Host, loop: FastLoop) -> None:
    host.link_watch.watch = lambda state: None
    host._receive(message_of("heartbeat", 3))
    with pytest.raises(Stale, match="not reported its position"):
        position_of(host.fleet.vehicles[3], loop.time(), max_age=5, link_timeout=5, has_position=True)


@pytest.mark.parametrize("fix", [1, 2])
def test_without_a_3d_fix_nothing_is_reported(telemetry: TelemetrySource, loop: FastLoop, fix: int) -> None:
    telemetry.send("gps_raw_int", fix_type=fix)
    with pytest.raises(NoFix, match="no position fix"):
        where(telemetry, loop.time())


def test_a_second_receiver_with_a_fix_will_do(telemetry: TelemetrySource, loop: FastLoop) -> None:
    telemetry.send("gps_raw_int", fix_type=1)
    telemetry.send("gps2_raw", fix_type=3)
    assert where(telemetry, loop.time()).lat == -15.840081


def test_a_receiver_that_has_fallen_silent_does_not_count(telemetry: TelemetrySource, loop: FastLoop) -> None:
    telemetry.send("gps2_raw", fix_type=3)
    loop.now += 6
    telemetry.send_all()
    telemetry.send("gps_raw_int", fix_type=1)
    with pytest.raises(NoFix, match="no position fix"):
        where(telemetry, loop.time())


def test_a_battery_that_is_not_measured_is_left_out(telemetry: TelemetrySource, loop: FastLoop) -> None:
    telemetry.send("sys_status", battery_remaining=-1)
    assert "battery_percent" not in form(telemetry, loop.time())


def test_without_a_receiver_the_estimator_decides(telemetry: TelemetrySource, loop: FastLoop) -> None:
    telemetry.send("gps_raw_int", fix_type=0)
    assert where(telemetry, loop.time(), has_position=True)
    with pytest.raises(NoFix):
        where(telemetry, loop.time(), has_position=False)


@pytest.mark.parametrize("fields", [{"lat": 0, "lon": 0}, {"lat": 910000000}, {"lon": -1810000000}])
def test_a_place_that_is_none_is_not_reported(
    telemetry: TelemetrySource, loop: FastLoop, fields: dict[str, int]
) -> None:
    telemetry.send("global_position_int", **fields)
    with pytest.raises(NoFix):
        where(telemetry, loop.time())


def test_zero_latitude_alone_is_a_place(telemetry: TelemetrySource, loop: FastLoop) -> None:
    telemetry.send("global_position_int", lat=0)
    assert where(telemetry, loop.time()).lat == 0.0


def test_what_is_not_a_number_is_left_out(telemetry: TelemetrySource, loop: FastLoop) -> None:
    telemetry.send("vfr_hud", airspeed=math.nan, groundspeed=math.inf)
    fields = form(telemetry, loop.time())
    assert "air_speed" not in fields and "ground_speed" not in fields
    assert "nan" not in position_update.encode(fields).decode().lower()


def test_without_a_fresh_vfr_hud_the_position_has_speed_and_heading(
    telemetry: TelemetrySource, loop: FastLoop
) -> None:
    loop.now += 6.0
    for name in ("heartbeat", "gps_raw_int"):
        telemetry.send(name)
    telemetry.send("global_position_int", vx=300, vy=400, hdg=27049)
    fields = form(telemetry, loop.time())
    assert (fields["ground_speed"], fields["heading"]) == ("5.0", "270")
    assert "air_speed" not in fields and "battery_percent" not in fields
    telemetry.send("global_position_int", hdg=65535)
    assert "heading" not in form(telemetry, loop.time())


def test_a_vehicle_that_is_not_ready_says_so(telemetry: TelemetrySource, loop: FastLoop) -> None:
    assert form(telemetry, loop.time(), ready=False)["ready_to_arm"] == "False"


def test_speeds_are_reported_without_the_noise_of_single_precision(
    telemetry: TelemetrySource, loop: FastLoop
) -> None:
    telemetry.send("vfr_hud", groundspeed=1.100000023841858)
    assert form(telemetry, loop.time())["ground_speed"] == "1.1"
