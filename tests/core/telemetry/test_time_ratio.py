from __future__ import annotations

import random

import pytest

from mavproxy_uavapi.core.telemetry.time_ratio import LATE, TWO_CLOCKS_FOR, WINDOW, WRAP, TimeRatio


def run(ratio: TimeRatio, seconds: float, speed: float, boot_ms: int = 10_000) -> None:
    for tenth in range(round(seconds * 10) + 1):
        ratio.update(boot_ms + round(tenth * 100 * speed), "ATTITUDE", 50.0 + tenth / 10)


@pytest.mark.parametrize("speed", [0.5, 1.0, 10.0])
def test_ratio_is_measured_from_the_boot_time(speed: float) -> None:
    ratio = TimeRatio()
    run(ratio, WINDOW + 0.1, speed)
    assert ratio.ratio == pytest.approx(speed, rel=0.01)


def test_ratio_is_one_until_the_first_window_is_over() -> None:
    ratio = TimeRatio()
    run(ratio, WINDOW - 0.1, 10.0)
    assert ratio.ratio == 1.0


def test_ratio_follows_a_change_of_speed() -> None:
    ratio = TimeRatio()
    for second in range(6):
        ratio.update(1000 + 1000 * second, "ATTITUDE", float(second))
    for second in range(6, 11):
        ratio.update(6000 + 5000 * (second - 5), "ATTITUDE", float(second))
    assert ratio.ratio == pytest.approx(5.0)


def test_ratio_stays_above_zero_when_the_vehicles_clock_stands_still() -> None:
    ratio = TimeRatio()
    run(ratio, 11, 0.0)
    assert ratio.ratio == 0.01


def test_boot_time_that_falls_back_far_is_a_reboot() -> None:
    ratio = TimeRatio()
    assert not ratio.update(60_000, "ATTITUDE", 1.0)
    assert ratio.update(500, "ATTITUDE", 2.0)
    assert not ratio.update(600, "ATTITUDE", 2.1)


def test_reboot_does_not_spoil_the_ratio() -> None:
    ratio = TimeRatio()
    ratio.update(60_000, "ATTITUDE", 1.0)
    ratio.update(500, "ATTITUDE", 2.0)
    ratio.update(6_500, "ATTITUDE", 8.0)
    assert ratio.ratio == pytest.approx(1.0)


def test_message_that_was_overtaken_on_another_link_is_no_reboot() -> None:
    ratio = TimeRatio()
    ratio.update(60_000, "ATTITUDE", 1.0)
    assert not ratio.update(57_500, "ATTITUDE", 1.1)
    assert not ratio.update(60_100, "ATTITUDE", 1.2)


@pytest.mark.parametrize(("boot_ms", "name"), [(None, "HEARTBEAT"), (0, "ATTITUDE"), (500, "GLOBAL_POSITION_INT")])
def test_messages_without_a_true_boot_time_do_not_count(boot_ms: int | None, name: str) -> None:
    ratio = TimeRatio()
    ratio.update(60_000, "ATTITUDE", 1.0)
    assert not ratio.update(boot_ms, name, 2.0)


def test_boot_time_that_wraps_after_49_days_is_no_reboot_and_goes_on() -> None:
    ratio = TimeRatio()
    for tenth in range(200):
        boot_ms = (WRAP - 10_050 + 100 * tenth) % WRAP
        assert not ratio.update(boot_ms, "ATTITUDE", 50.0 + tenth / 10)
    assert ratio.ratio == pytest.approx(1.0)
    assert ratio.boot_time(69.9) == pytest.approx((WRAP - 10_050 + 19_900) / 1000)


def test_wrap_during_a_silence_of_the_link_is_no_reboot() -> None:
    ratio = TimeRatio()
    ratio.update(WRAP - 1000, "ATTITUDE", 50.0)
    assert not ratio.update(3_600_000, "ATTITUDE", 50.0 + 3_601.0)


def test_message_from_before_a_wrap_that_was_overtaken_changes_nothing() -> None:
    ratio = TimeRatio()
    ratio.update(WRAP - 100, "ATTITUDE", 50.0)
    assert not ratio.update(50, "ATTITUDE", 50.15)
    assert not ratio.update(WRAP - 50, "ATTITUDE", 50.16)
    assert ratio.boot_time(50.15) == pytest.approx((WRAP + 50) / 1000)
    assert not ratio.update(150, "ATTITUDE", 50.25)


@pytest.mark.parametrize("days", [20, 30, 49.5])
def test_reboot_after_a_long_time_is_a_reboot_all_the_same(days: float) -> None:
    ratio = TimeRatio()
    ratio.update(round(days * 86_400_000), "ATTITUDE", 50.0)
    assert ratio.update(1000, "ATTITUDE", 60.0)


def test_reboot_after_a_wrap_is_a_reboot() -> None:
    ratio = TimeRatio()
    ratio.update(WRAP - 100, "ATTITUDE", 50.0)
    ratio.update(7_200_000, "ATTITUDE", 7250.0)
    assert ratio.update(1000, "ATTITUDE", 7260.0)
    assert ratio.boot_time(7260.0) == pytest.approx(1.0)


@pytest.mark.parametrize("apart", [5, 50, 5000])
@pytest.mark.parametrize("leaves", ["newer", "older"])
def test_vehicle_whose_double_is_gone_is_one_again(leaves: str, apart: int) -> None:
    ratio = TimeRatio()
    clocks = {"older": apart + 1.0, "newer": 0.5}  # s since the boot at 20 s, when the second one comes
    for quarter in range(400):
        now = quarter / 4
        here = [name for name in clocks if (name == "older" or now >= 20) and (now < 40 or name != leaves)]
        for name in here:
            ratio.update(round(1000 * (clocks[name] + now - 20 * (name == "newer"))), "ATTITUDE", now)
        if now in (19.0, 55.0, 99.0):
            assert not ratio.has_two_clocks(now)
        if 24.0 < now < 40.0:
            assert ratio.has_two_clocks(now)
    left = clocks["older" if leaves == "newer" else "newer"] + now - 20 * (leaves == "older")
    assert ratio.boot_time(now) == pytest.approx(left, abs=0.01)


@pytest.mark.parametrize("late", [3.2, 3.9])
def test_messages_that_were_long_on_their_way_make_no_second_clock(late: float) -> None:
    """A link that took 2 to 4 s, and takes none any more: for a while the new messages come between the old ones."""
    ratio, arrivals = TimeRatio(), [(tick / 4, tick / 4) for tick in range(80)]
    arrivals += [(10.0 + tick / 20, 10.0 + tick / 20 - late) for tick in range(8)]
    for now, sent_at in sorted(arrivals):
        ratio.update(round(sent_at * 1000) + 60_000, "ATTITUDE", now, 0.07)
        assert not ratio.has_two_clocks(now), now


@pytest.mark.parametrize("seed", range(20))
def test_double_on_a_link_that_reorders_is_forgotten_when_it_is_gone(seed: int) -> None:
    """What is long on its way goes on with neither clock: the vehicle's own must not become a second one by it."""
    chance, ratio, told_at = random.Random(seed), TimeRatio(), [0.0]
    arrivals = [(second + chance.uniform(0, 4), 1_000_000 + 1000 * second) for second in range(100)]
    arrivals += [(20 + second + chance.uniform(0, 4), 1000 + 1000 * second) for second in range(12)]
    for now, boot_ms in sorted(arrivals):
        ratio.update(boot_ms, "ATTITUDE", now, 9.0)
        told_at += [now] * ratio.has_two_clocks(now)
    assert max(told_at) < 36.0 + LATE + TWO_CLOCKS_FOR


@pytest.mark.parametrize("boot_ms", [WRAP - 1, WRAP // 2, 600_000])
def test_one_time_that_no_clock_could_have_reached_is_no_reboot(boot_ms: int) -> None:
    ratio = TimeRatio()
    run(ratio, 2.0, 1.0)
    assert not ratio.update(boot_ms, "ATTITUDE", 52.05)
    assert not ratio.update(12_100, "ATTITUDE", 52.1)
    assert ratio.boot_time(52.1) == pytest.approx(12.1)


def test_times_that_stand_where_no_clock_could_be_are_not_believed() -> None:
    ratio = TimeRatio()
    for tenth in range(100):
        assert not ratio.update(10_000 + 100 * tenth, "ATTITUDE", 50 + tenth / 10)
        assert not ratio.update(WRAP - 1, "ATTITUDE", 50.05 + tenth / 10)


def test_control_a_second_clock_that_goes_on_far_ahead_is_one() -> None:
    ratio = TimeRatio()
    for tenth in range(100):
        ratio.update(10_000 + 100 * tenth, "ATTITUDE", 50 + tenth / 10)
        ratio.update(900_000 + 100 * tenth, "ATTITUDE", 50.05 + tenth / 10)
    assert ratio.has_two_clocks(60.0)
