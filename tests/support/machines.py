"""How state machines of hypothesis are run, and what several of them do."""

from __future__ import annotations

from collections.abc import Callable

from hypothesis import HealthCheck, Phase, settings
from hypothesis.stateful import RuleBasedStateMachine, run_state_machine_as_test

from mavproxy_uavapi.core.control.jobs import Ending
from mavproxy_uavapi.core.errors import Aborted
from tests.support.virtual_world import VirtualWorld

GONE_AFTER = 15.0  # s from which a second autopilot that is gone is forgotten


def run_machine(machine: type[RuleBasedStateMachine], wanted: int, in_ci: int, parts: int, steps: int) -> None:
    """Take a part of the steps that are wanted, `steps` in a flight; as many as `in_ci` are the same in each run."""
    is_usual = wanted == in_ci
    run_state_machine_as_test(
        machine,
        settings=settings(
            max_examples=max(1, wanted // steps // parts),
            stateful_step_count=steps,
            derandomize=is_usual,
            database=None,
            deadline=None,
            phases=[Phase.explicit, Phase.generate, *([] if is_usual else [Phase.shrink])],
            suppress_health_check=list(HealthCheck),
        ),
    )


def meet_second_autopilot(
    world: VirtualWorld, seconds: float, then: Callable[[float], object], ask: Callable[[], object]
) -> None:
    """One with the same system id comes for so many s, while a client asks; until it is gone and forgotten."""
    world.double()
    for _ in range(3):
        then(seconds / 4)
        ask()
    then(seconds / 4)
    world.part()
    for job in world.host.jobs.running():
        job.abort(Aborted("the flight is over"), Ending.SUPERSEDED)
    then(GONE_AFTER + world.way + world.jitter)
    assert not world.known.state.are_two(world.now)
