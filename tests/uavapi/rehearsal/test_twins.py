from __future__ import annotations

import signal
from pathlib import Path

import pytest

from mavproxy_uavapi.launcher.errors import LaunchError
from mavproxy_uavapi.rehearsal import twins
from mavproxy_uavapi.rehearsal.truth import VehicleTruth
from mavproxy_uavapi.rehearsal.twins import Twins
from mavproxy_uavapi.sim.options import Options
from mavproxy_uavapi.sim.simulator import Simulator
from tests.support.climbing import until_it_hovers
from tests.support.rehearsed import record


@pytest.fixture
def truth() -> VehicleTruth:
    """That of a copter that hovers in GUIDED, 10 m above home."""
    simulator = Simulator(Options(ready_after=1.0, step=0.02))
    simulator.run(2.0)
    truth = VehicleTruth(simulator)
    copter = simulator.copter
    assert copter.set_mode(4) and copter.arm(forced=True)
    copter.mode.take_off(10.0)  # type: ignore[attr-defined]
    until_it_hovers(simulator, 10.0)
    return truth


def test_twins_fly_on_from_moments_of_the_flight_which_goes_on_as_it_was(truth: VehicleTruth, tmp_path: Path) -> None:
    flown, flying = record(truth.sample()), Twins(tmp_path)
    for seconds in (0.0, 1.0, 9.5):
        truth.simulator.run(seconds)
        flown.samples[1].append(truth.sample())
        before = truth.simulator.vehicle.now
        flying.look([truth], flown)
        assert truth.simulator.vehicle.now == before
    flying.end(flown)
    begins = [flown.samples[1][1].at, flown.samples[1][3].at]
    assert [(loss.at, loss.what, loss.mode, loss.armed) for loss in flown.losses] == [
        (at, *end) for at in begins for end in (("link", "GUIDED", True), ("gps", "LAND", False))
    ]
    assert flown.losses[0].height == pytest.approx(10.0, abs=0.5)
    assert all(20.0 <= loss.seconds <= 60.0 for loss in flown.losses)


def test_twin_that_fails_is_told(truth: VehicleTruth, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(twins, "LOSSES", {"gps": "no_such_fault"})
    flown, flying = record(truth.sample()), Twins(tmp_path)
    flying.look([truth], flown)
    with pytest.raises(LaunchError, match="without its gps could not be found out"):
        flying.end(flown)


def test_twins_that_are_killed_leave_nothing(
    truth: VehicleTruth, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(twins, "_end", lambda truth, what: signal.pause())  # it never ends by itself
    flown, flying = record(truth.sample()), Twins(tmp_path)
    flying.look([truth], flown)
    flying.kill()  # waits for them
    assert not list(tmp_path.iterdir())
