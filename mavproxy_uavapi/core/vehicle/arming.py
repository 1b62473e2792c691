"""Arming and disarming. A pilot who arms the vehicle meanwhile keeps it."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from dataclasses import replace

from mavproxy_uavapi.core.control.jobs import MOMENT, Job
from mavproxy_uavapi.core.control.mode_switch import Overtaken
from mavproxy_uavapi.core.errors import REBOOTED, Expired, ModeChanged, NotArmed, Rejected, TimedOut
from mavproxy_uavapi.core.link import messages
from mavproxy_uavapi.core.mainloop.permit import ORDER_LASTS, Written
from mavproxy_uavapi.core.vehicle.base import BaseVehicle

TIMEOUT = 90.0  # s until an estimator that does not settle is reported
REASON_TIME = 2.0  # s of a client's timeout that are kept for asking why the vehicle is not ready
SHOWN_WITHIN = 5.0  # s until a heartbeat must show what was acknowledged
GUIDED = "GUIDED"


async def arm(vehicle: BaseVehicle, job: Job, timeout: float | None) -> None:
    """See `Vehicle.arm`."""
    check_unclaimed = _requires_unclaimed(vehicle, job)
    is_ours = vehicle.state.armed or vehicle.arm_is_on_its_way
    deadline = vehicle.clock() + (max(timeout - REASON_TIME, timeout / 2) if timeout else TIMEOUT)
    await _get_ready(vehicle, job, lambda: vehicle.has_position, check_unclaimed, deadline)
    if vehicle.mode != GUIDED:
        await vehicle.command(job).switch_mode(GUIDED, check_unclaimed)
    still_guided = _requires_guided(vehicle, job)
    await _get_ready(vehicle, job, lambda: vehicle.is_ready_to_arm, still_guided, deadline)
    still_guided()

    def shown() -> bool:
        still_guided()
        return bool(vehicle.state.armed)

    written = Written()

    def still_disarmed() -> None:
        if vehicle.state.armed and not written.value:
            raise ModeChanged(f"the pilot or another client has armed the vehicle, in {vehicle.mode}")
        vehicle.arm_sent_at = vehicle.clock()

    if not (is_ours and vehicle.state.armed):
        still_disarmed()
        vehicle.arm_written = written
        try:
            await vehicle.command(job).send(
                messages.arm(), still_guided, still_disarmed, shown=shown, written=written
            )
        except Rejected:
            vehicle.arm_sent_at = -math.inf
            raise
    # Not sent again: a pilot may have disarmed it meanwhile.
    await vehicle.waiting.until(
        {"HEARTBEAT"}, lambda: vehicle.state.armed or None, SHOWN_WITHIN, "show that it is armed"
    )
    vehicle.arm_sent_at = -math.inf


async def disarm(vehicle: BaseVehicle, job: Job, force: bool) -> None:
    """See `Vehicle.disarm`. A heartbeat from before the order shows nothing.

    Our own order to arm may arrive after the next heartbeat. Then only the acknowledgement counts.

    Raises:
        ModeChanged: it is armed again.
    """
    order, command = messages.disarm(force), vehicle.command(job)
    began = sent_at = vehicle.clock()
    arms = [Overtaken(order.number, vehicle.arm_sent_at, vehicle.arm_arrives_by, lambda: bool(vehicle.state.armed))]

    def shown() -> bool:
        return vehicle.state.armed is False and vehicle.state.came_after(sent_at)

    order = replace(order, proven_by_ack=vehicle.arm_is_on_its_way)
    while True:
        sent_at = vehicle.clock()
        await command.send_until_shown(order, shown=shown, action="show that it is disarmed")
        if not await command.is_undone(arms, began, lambda: vehicle.state.armed is False):
            break
        began = vehicle.clock()
    vehicle.arm_sent_at = -math.inf
    if vehicle.state.armed:
        raise ModeChanged("the vehicle is armed again: by its pilot, or by what was on its way")


def _requires_unclaimed(vehicle: BaseVehicle, job: Job) -> Callable[[], None]:
    """A check that raises ModeChanged if somebody else armed it since now, or switched its mode since the request."""
    was_armed = vehicle.state.armed

    def check() -> None:
        _require_no_reboot(vehicle, job)
        if vehicle.mode == GUIDED or vehicle.state.mode is None:
            return
        is_switched = vehicle.state.mode_since > job.began_at and vehicle.mode not in job.modes
        if vehicle.state.armed and (not was_armed or is_switched or vehicle.is_under_way):
            raise ModeChanged(f"the pilot or another client has armed the vehicle, in {vehicle.mode}")
        if is_switched:
            raise ModeChanged(f"the pilot or another client switched the vehicle to {vehicle.mode} meanwhile")

    return check


def _requires_guided(vehicle: BaseVehicle, job: Job) -> Callable[[], None]:
    def check() -> None:
        _require_no_reboot(vehicle, job)
        if vehicle.state.mode is not None:  # after a reboot the next heartbeat has the mode
            vehicle.require_mode(GUIDED)

    return check


def _require_no_reboot(vehicle: BaseVehicle, job: Job) -> None:
    """Raise NotArmed if the vehicle has booted since the request: who changes its battery is near it."""
    if vehicle.state.rebooted_at > job.began_at:
        raise NotArmed(REBOOTED)


async def _get_ready(
    vehicle: BaseVehicle, job: Job, is_ready: Callable[[], bool], check: Callable[[], None], deadline: float
) -> None:
    """Wait until it is ready. After a longer wait also hear a heartbeat: the pilot may have taken it meanwhile.

    Raises:
        Expired: MAVProxy's main loop stood meanwhile for longer than an order lasts.
        Rejected: it did not get ready.
    """

    def ready() -> bool | None:
        job.require_permit()
        check()
        return True if is_ready() or vehicle.state.armed else None

    began = vehicle.clock()
    remaining = max(deadline - began, 0.1)
    names = {"SYS_STATUS", "EKF_STATUS_REPORT", "HEARTBEAT"}
    try:
        await vehicle.waiting.until(names, ready, remaining, "get ready")
    except TimedOut:
        raise await _why_not_ready(vehicle, remaining) from None
    has_waited = vehicle.clock() - began > MOMENT or (job.is_late and vehicle.mode != GUIDED)
    if has_waited and not vehicle.state.armed:
        await vehicle.wait_for_heartbeat()
        check()
    if vehicle.waiting.listening.longest_stand(began) > ORDER_LASTS:
        raise Expired.after(ORDER_LASTS)


async def _why_not_ready(vehicle: BaseVehicle, waited: float) -> Rejected:
    asked_at = vehicle.clock()
    with contextlib.suppress(Rejected, TimedOut):  # only the texts that it triggers count
        await vehicle.ask(messages.check_prearm())
    with contextlib.suppress(TimedOut):
        await vehicle.waiting.message(
            {"STATUSTEXT"}, lambda _: None, 1.0, "fall silent"
        )  # there may be several reasons
    texts = vehicle.state.statustexts.since(asked_at)
    because = "; ".join(texts) or "it does not say why"
    return Rejected(f"not ready to arm after {waited:.0f} s: {because}", statustext=texts)
