from __future__ import annotations

import math
from typing import Any

from mavproxy_gradys.forwarding.quantities import parse_quantity
from mavproxy_gradys.forwarding.readings import Sampler
from mavproxy_uavapi.core.host import Host
from tests.gradys.conftest import TelemetrySource
from tests.support.messages import message_of
from tests.support.virtual_time import FastLoop

ALT = parse_quantity("alt=GLOBAL_POSITION_INT.relative_alt*0.001@1[m]")


def sample(sampler: Sampler, telemetry: TelemetrySource, now: float) -> Any:
    return sampler.sample(telemetry.state, now, 1_800_000_000.0, 5.0)


def test_a_field_of_a_message_scaled_with_the_time_at_which_it_came(
    telemetry: TelemetrySource, loop: FastLoop
) -> None:
    reading = sample(Sampler(ALT), telemetry, loop.time() + 0.5)
    assert (reading.quantity, reading.value, reading.representation) == ("alt", 20.123, "m")
    assert (reading.device, reading.system, reading.time) == ("uav-10", 10, 1_799_999_999.5)


def test_one_message_is_one_measurement(telemetry: TelemetrySource, loop: FastLoop) -> None:
    sampler = Sampler(ALT)
    assert sample(sampler, telemetry, loop.time())
    assert sample(sampler, telemetry, loop.time() + 1) is None
    assert "no new" in sampler.why_not[10]
    loop.now += 2
    telemetry.send_all()
    assert sample(sampler, telemetry, loop.time())
    assert sampler.why_not == {} and sampler.taken == 2


def test_old_and_missing_messages_are_no_measurement(telemetry: TelemetrySource, loop: FastLoop) -> None:
    sampler = Sampler(ALT)
    assert sample(sampler, telemetry, loop.time() + 6) is None
    assert "6.0 s old" in sampler.why_not[10]
    other = Sampler(parse_quantity("rpm=RPM.rpm1"))
    assert sample(other, telemetry, loop.time()) is None
    assert "has not arrived yet" in other.why_not[10]


def test_what_is_no_number_is_no_measurement(telemetry: TelemetrySource, loop: FastLoop) -> None:
    telemetry.send("vfr_hud", airspeed=math.nan)
    for text in ("a=VFR_HUD.airspeed", "b=VFR_HUD.nothing", "c=VFR_HUD.heading[3]"):
        sampler = Sampler(parse_quantity(text))
        assert sample(sampler, telemetry, loop.time()) is None
        assert "no such number" in sampler.why_not[10]


def test_what_scaling_makes_too_large_is_no_measurement(telemetry: TelemetrySource, loop: FastLoop) -> None:
    sampler = Sampler(parse_quantity("a=VFR_HUD.heading*1e308"))
    assert sample(sampler, telemetry, loop.time()) is None
    assert "no such number" in sampler.why_not[10]


def test_a_field_with_capitals(telemetry: TelemetrySource, loop: FastLoop) -> None:
    telemetry.send("power_status", Vcc=5012)
    assert sample(Sampler(parse_quantity("vcc=POWER_STATUS.Vcc*0.001[V]")), telemetry, loop.time()).value == 5.012


def test_a_message_of_another_component(host: Host, telemetry: TelemetrySource, loop: FastLoop) -> None:
    host._receive(message_of("distance_sensor", 10, 158, current_distance=250, quaternion=[0.0] * 4))
    sampler = Sampler(parse_quantity("range=DISTANCE_SENSOR.current_distance*0.01[m]"))
    assert sample(sampler, telemetry, loop.time()).value == 2.5


def test_an_element_of_an_array(telemetry: TelemetrySource, loop: FastLoop) -> None:
    telemetry.send("battery_status", voltages=[4100, 4090] + [65535] * 8, voltages_ext=[0] * 4)
    reading = sample(Sampler(parse_quantity("cell=BATTERY_STATUS.voltages[1]*0.001")), telemetry, loop.time())
    assert reading.value == 4.09
