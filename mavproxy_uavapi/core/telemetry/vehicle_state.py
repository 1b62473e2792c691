"""Message in -> what we know of a vehicle, with the time it arrived. Pure: the clock is an argument."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Any

from pymavlink import mavutil

from mavproxy_uavapi.core.errors import Busy
from mavproxy_uavapi.core.telemetry import autopilot
from mavproxy_uavapi.core.telemetry.flight_modes import kind_of
from mavproxy_uavapi.core.telemetry.packet_loss import PacketLoss, is_before
from mavproxy_uavapi.core.telemetry.readings import GlobalPosition, HomePlace, LocalPosition
from mavproxy_uavapi.core.telemetry.statustexts import StatusTexts
from mavproxy_uavapi.core.telemetry.time_ratio import NOT_BOOT_TIME, TimeRatio
from mavproxy_uavapi.core.telemetry.trip import Trip

mavlink = mavutil.mavlink

RATE_SMOOTHING = 0.2  # weight of the newest interval in the smoothed rate
MODE_CHANGES_KEPT = 16
ACKS_KEPT = 64
COPY_WITHIN = 3.0  # s in which a second copy of an ack may come: another link, a router
RECENT = 5.0  # s before the newest heartbeat; an older report does not show the present state
CLOCKED_KEPT = 64  # messages with the vehicle's own time, of which the newest before a heartbeat dates it
CLOCKED_WITHIN = 3.0  # s before a heartbeat; an older one does not date it
HEARTBEAT_PERIOD = 1.0  # s
# What flights are checked with: a message with a number that is not finite counts as not received.
FLOWN_BY = {
    "ATTITUDE",
    "EKF_STATUS_REPORT",
    "LOCAL_POSITION_NED",
    "PARAM_VALUE",
    "POSITION_TARGET_GLOBAL_INT",
    "POSITION_TARGET_LOCAL_NED",
}
FAILING = {mavlink.MAV_STATE_CRITICAL, mavlink.MAV_STATE_EMERGENCY}
ARMED = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
# What is outdated after a reboot; the rest is soon overwritten.
FORGOTTEN_AT_REBOOT = ("HOME_POSITION", "HEARTBEAT", "EXTENDED_SYS_STATE", "SYS_STATUS", "EKF_STATUS_REPORT")


@dataclass
class Received:
    """The newest message of one name: the message, when it arrived (s), how many came, and how often.

    `waited`: whether it may have waited in MAVProxy; then `at` is the earliest time at which it can have come.
    """

    message: Any
    at: float
    waited: bool = False
    count: int = 1
    interval: float | None = None

    def renew(self, message: Any, at: float, *, waited: bool = False) -> None:
        """Take a newer message."""
        elapsed = at - self.at
        if not waited and not self.waited:  # else it does not tell how often they come
            self.interval = (
                elapsed if self.interval is None else self.interval + RATE_SMOOTHING * (elapsed - self.interval)
            )
        self.message, self.at, self.waited, self.count = message, at, waited, self.count + 1

    def rate(self, now: float) -> float:
        """Messages per second (Hz), smoothed; it falls when they stop."""
        if self.interval is None:
            return 0.0
        return 1.0 / max(self.interval, now - self.at, 1e-3)


@dataclass
class VehicleState:
    """What we know of one vehicle: the autopilot component of one system id.

    Attributes:
        system, component: its MAVLink address.
        vehicle_type: MAV_TYPE of its heartbeats; GENERIC only until one says more.
        armed: whether it is armed; None until the first heartbeat since the last boot.
        mode: the heartbeat's custom_mode; None likewise.
        system_status: MAV_STATE of the heartbeat; None likewise.
        heartbeat_at: arrival of the newest heartbeat (s); of one that may have waited in MAVProxy, the earliest time.
        heartbeat_before_at: that of the heartbeat before it.
        heartbeat_left: the vehicle's clock (s since its boot) when the newest heartbeat left it, or earlier; None
            where no message with its time came shortly before.
        mode_since: arrival of the heartbeat that first showed the mode (s).
        mode_place: where it was then; None while unknown.
        mode_target: the first POSITION_TARGET_GLOBAL_INT in that mode; None before it.
        mode_changes: the newest of those: arrival and mode, oldest first.
        messages: newest message by name, and by `NAME[instance]` for those that come for several devices.
        others: newest message by (component, name), of the system's other components.
        acks: the newest COMMAND_ACKs and when they arrived (s), each once; oldest first.
        ack_is_copy: whether the newest one is a second copy, which counts for nothing.
        banner: what the autopilot said it is, such as "ArduCopter V4.6.3 (3fc7011a)"; empty until it has.
        statustexts: what it said.
        packets: how many of its messages arrived.
        reboots, rebooted_at: how often it has booted since we know it, and when that showed last (s).
        armings: how often a heartbeat showed that it was armed; each moves home.
        parameters: values by name, from PARAM_VALUE or MAVProxy's own table. A reboot does not change them.
    """

    system: int
    component: int
    vehicle_type: int
    heartbeat_at: float
    armed: bool | None = None
    mode: int | None = None
    system_status: int | None = None
    mode_since: float = 0.0
    mode_place: GlobalPosition | None = None
    mode_target: Any = None
    mode_changes: deque[tuple[float, int]] = field(default_factory=lambda: deque(maxlen=MODE_CHANGES_KEPT))
    messages: dict[str, Received] = field(default_factory=dict)
    others: dict[tuple[int, str], Received] = field(default_factory=dict)
    parameters: dict[str, float] = field(default_factory=dict)
    statustexts: StatusTexts = field(default_factory=StatusTexts)
    acks: deque[tuple[float, Any]] = field(default_factory=lambda: deque(maxlen=ACKS_KEPT))
    ack_is_copy: bool = False
    reboots: int = 0
    rebooted_at: float = -math.inf
    armings: int = 0
    banner: str = ""
    packets: PacketLoss = field(default_factory=PacketLoss)
    time_ratio: TimeRatio = field(default_factory=TimeRatio)
    trip: Trip = field(default_factory=Trip)
    heartbeat_before_at: float = -math.inf
    heartbeat_left: float | None = None
    _clocked: deque[tuple[int, float, float]] = field(default_factory=lambda: deque(maxlen=CLOCKED_KEPT))
    _heartbeat_sequence: int | None = None

    def newest(self, name: str) -> Received | None:
        """The newest message of that name; the autopilot's own before another component's."""
        if name in self.messages:
            return self.messages[name]
        candidates = [received for (_, n), received in self.others.items() if n == name]
        return max(candidates, key=lambda received: received.at, default=None)

    @property
    def firmware(self) -> str:
        """What the autopilot runs: its banner, or its AUTOPILOT_VERSION; empty while unknown."""
        received = self.messages.get("AUTOPILOT_VERSION")
        if self.banner or received is None:
            return self.banner
        version, code = received.message.flight_sw_version, bytes(received.message.flight_custom_version)
        kind = autopilot.VERSION_TYPES.get(version & 0xFF, "")
        numbers = ".".join(str(version >> shift & 0xFF) for shift in (24, 16, 8))
        return f"{kind_of(self.vehicle_type)} {numbers}{kind} ({code.rstrip(bytes(1)).decode('ascii', 'replace')})"

    @property
    def position(self) -> GlobalPosition | None:
        """Its newest position, of any age; None before the first."""
        received = self.messages.get("GLOBAL_POSITION_INT")
        return None if received is None else GlobalPosition.of(received.message)

    @property
    def local_position(self) -> LocalPosition | None:
        """Its newest position in the EKF's frame, of any age; None before the first."""
        received = self.messages.get("LOCAL_POSITION_NED")
        return None if received is None else LocalPosition.of(received.message)

    @property
    def home(self) -> HomePlace | None:
        """Its home; None while it is unknown: before the first report, after a reboot and after arming."""
        received = self.messages.get("HOME_POSITION")
        return None if received is None else HomePlace.of(received.message)

    def field(self, name: str, attribute: str) -> Any:
        """One field of the autopilot's newest message of that name; None when there is none yet."""
        received = self.messages.get(name)
        return None if received is None else getattr(received.message, attribute)

    def recent_field(self, name: str, attribute: str) -> Any:
        """As `field`, but None as well when the message is much older than the newest heartbeat.

        After a reboot the streams may be off; a report from before it does not show the present state.
        """
        received = self.messages.get(name)
        return getattr(received.message, attribute) if received is not None and self.is_recent(received) else None

    def is_recent(self, received: Received) -> bool:
        """Whether a message is not much older than the newest heartbeat."""
        return self.heartbeat_at - received.at <= RECENT

    def age(self, name: str, now: float) -> float | None:
        """Seconds since a message of that name arrived; None when none did."""
        received = self.messages.get(name)
        return None if received is None else now - received.at

    def are_two(self, now: float) -> bool:
        """Whether two autopilots have this system id, as far as their clocks and answers tell them apart."""
        return self.time_ratio.has_two_clocks(now) or self.trip.is_answered_twice(now)

    def require_one(self, now: float) -> None:
        """Raise Busy if two autopilots have this system id: what one of them shows is not what the other does."""
        if self.are_two(now):
            raise Busy(f"two autopilots have the system id {self.system}: change SYSID_THISMAV (MAV_SYSID) of one")

    def heard_since(self, at: float) -> bool:
        """Whether the newest heartbeat tells what a pilot has done until `at` (s): it arrived later.

        One that has waited in MAVProxy or on the link for longer than a heartbeat's period does not tell it.
        """
        if self.heartbeat_at <= at:
            return False
        if self.heartbeat_left is None or not self.trip.knows_clock:
            return True
        return self.heartbeat_left >= self.trip.time_at(at, self.time_ratio.ratio) - HEARTBEAT_PERIOD

    def heartbeat_follows(self, message: Any) -> bool:
        """Whether the newest heartbeat left the vehicle after one of its recent messages, by their numbers."""
        if self._heartbeat_sequence is None:
            return False
        return is_before(message.get_seq(), self._heartbeat_sequence)

    def came_after(self, sent_at: float, name: str = "HEARTBEAT") -> bool:
        """Whether the newest message of that name came so long after what we sent then (s) that it left later.

        Before a measurement of the trip the arrival must do.
        """
        received = self.messages.get(name)
        came_at = -math.inf if received is None else received.at
        if name == "HEARTBEAT":
            came_at = self.heartbeat_at  # one that was overtaken does not count
        return came_at > sent_at + (0.0 if self.trip.mean is None else self.trip.deadline)

    def shows(self, sent_at: float) -> bool:
        """Whether the newest heartbeat left the vehicle after what we sent at `sent_at` (s) had arrived, or was lost.

        By the vehicle's own clock. Where that is not known, the heartbeat before it must have arrived after the
        longest trip, too.
        """
        if self.heartbeat_at <= sent_at:
            return False
        if self.heartbeat_left is not None and self.trip.knows_clock:
            return self.heartbeat_left >= self.trip.arrived_by(sent_at, self.time_ratio.ratio)
        return self.heartbeat_before_at >= sent_at + self.trip.longest

    @property
    def is_failing(self) -> bool:
        """Whether its heartbeat reports a failsafe, be it one that only warns."""
        return self.system_status in FAILING

    @property
    def landed(self) -> bool | None:
        """Whether it stands on the ground; None while unknown.

        A rover or boat always does: its heartbeat says ACTIVE in every mode but HOLD, and it sends no landed state
        (ArduRover, vehicle_system_status). Any other vehicle does while it is disarmed. Else EXTENDED_SYS_STATE
        decides, or the heartbeat: STANDBY on the ground, ACTIVE in the air, CRITICAL for neither. For a copter the
        newer one of both counts; for a plane the heartbeat counts only while EXTENDED_SYS_STATE does not arrive.
        """
        kind = kind_of(self.vehicle_type)
        if kind == "rover":
            return True
        if self.armed is None or self.system_status is None:
            return None
        if not self.armed:
            return True
        received = self.messages.get("EXTENDED_SYS_STATE")
        if received is not None and received.message.landed_state:
            in_doubt = self.system_status in FAILING
            behind = self.heartbeat_at - received.at
            if in_doubt or behind <= (RECENT if kind == "plane" else 0.0):
                return bool(received.message.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND)
        return bool(self.system_status not in {mavlink.MAV_STATE_ACTIVE} | FAILING)

    def update(self, message: Any, now: float, came_after: float | None = None) -> None:
        """Take a message of this system that arrived at `now` (s).

        `came_after`: when it arrived at the earliest, if it may have waited in MAVProxy. Its age and what it shows
        count from then; it tells nothing of the link and of the vehicle's pace.
        """
        name, waited = message.get_type(), came_after is not None
        at = now if came_after is None else came_after
        if message.get_srcComponent() != self.component:
            _keep(self.others, (message.get_srcComponent(), name), message, at, waited=waited)
            return
        self.packets.count(message.get_seq(), now)
        boot_ms = getattr(message, "time_boot_ms", None)
        if not waited and self.time_ratio.update(boot_ms, name, now, self.trip.deadline):
            self.rebooted_at = now
            self._forget_what_a_reboot_changes()
        if boot_ms and name not in NOT_BOOT_TIME and self.time_ratio.can_be(boot_ms, now):
            self._clocked.append((message.get_seq(), boot_ms / 1000.0, at))
        if name in FLOWN_BY and not is_finite(message):
            return
        _keep(self.messages, name, message, at, waited=waited)
        instance = getattr(message, "_instance_field", None)
        if instance is not None:  # one message each for several batteries, compasses, servos …
            _keep(self.messages, f"{name}[{getattr(message, instance)}]", message, at, waited=waited)
        if name == "HEARTBEAT":
            self._take_heartbeat(message, now, at)
        elif name == "TIMESYNC" and message.tc1 and not waited:
            self.trip.answer(message.ts1, message.tc1 / 1e9, now, self.time_ratio.ratio)
        elif name == "COMMAND_ACK":
            self._take_ack(message, now)
        elif name == "POSITION_TARGET_GLOBAL_INT":
            self.mode_target = self.mode_target or message
        elif name == "STATUSTEXT":
            self.statustexts.take(message, now)
            if not message.id and autopilot.BANNER.match(message.text):
                self.banner = message.text
        elif name == "PARAM_VALUE":
            self.parameters[message.param_id] = message.param_value  # it is finite, see `update`
        self.statustexts.give_up_late_chunks(now)

    def become(self, component: int, vehicle_type: int, now: float) -> None:
        """Become the state of another component, which is the autopilot after all.

        Its messages so far count; those of the former component move to `others`.
        """
        former = {(self.component, name): received for name, received in self.messages.items() if "[" not in name}
        others = {**self.others, **former}
        own = {name: others.pop((c, name)) for c, name in list(others) if c == component}
        fresh = VehicleState(self.system, component, vehicle_type, now, messages=own, others=others)
        vars(self).update(vars(fresh))  # in place, because others hold this object

    def _time_left(self, sequence: int, now: float) -> float | None:
        """The newest time of the vehicle's that was sent before the message of that sequence number, s since boot."""
        before = [
            seconds
            for number, seconds, at in self._clocked
            if is_before(number, sequence) and now - at <= CLOCKED_WITHIN
        ]
        return max(before, default=None)

    def _is_overtaken(self, sequence: int, left: float | None) -> bool:
        """Whether a newer heartbeat has come before this one: by its number, and by the vehicle's clock."""
        if left is None or self.heartbeat_left is None or self._heartbeat_sequence is None:
            return False
        return is_before(sequence, self._heartbeat_sequence) and left <= self.heartbeat_left

    def _take_heartbeat(self, message: Any, now: float, at: float) -> None:
        sequence = message.get_seq()
        left = self._time_left(sequence, at)
        if self._is_overtaken(sequence, left):
            return
        self.heartbeat_before_at, self.heartbeat_at = self.heartbeat_at, at
        self.heartbeat_left, self._heartbeat_sequence = left, sequence
        if message.type != mavlink.MAV_TYPE_GENERIC:  # a copter that boots does not know its frame yet
            self.vehicle_type = message.type
        if message.custom_mode != self.mode:
            self.mode, self.mode_since = message.custom_mode, now
            self.mode_place, self.mode_target = self.position, None
            self.mode_changes.append((now, self.mode))
        was_armed, self.armed = self.armed, bool(message.base_mode & ARMED)
        if self.armed and was_armed is False:  # ArduPilot moves home then: what it was before is unknown now
            self.armings += 1
            self.messages.pop("HOME_POSITION", None)
        self.system_status = message.system_status

    def _take_ack(self, message: Any, now: float) -> None:
        key = message.get_seq(), message.command, message.result
        recent = (ack for at, ack in self.acks if now - at <= COPY_WITHIN)
        self.ack_is_copy = any(key == (ack.get_seq(), ack.command, ack.result) for ack in recent)
        if not self.ack_is_copy:
            self.acks.append((now, message))

    def _forget_what_a_reboot_changes(self) -> None:
        self.reboots += 1
        self.trip.forget_clock()
        self._clocked.clear()
        self.packets.begin_anew()
        self.armed = self.mode = self.system_status = None
        self.statustexts.forget_chunks()
        for name in FORGOTTEN_AT_REBOOT:
            self.messages.pop(name, None)


def is_finite(message: Any) -> bool:
    """Whether every number in a message is finite."""
    for name in message.get_fieldnames():
        value = getattr(message, name)
        for number in value if isinstance(value, list | tuple) else (value,):
            if isinstance(number, float) and not math.isfinite(number):
                return False
    return True


def _keep(store: dict[Any, Received], key: Any, message: Any, at: float, *, waited: bool) -> None:
    if key in store:
        store[key].renew(message, at, waited=waited)
    else:
        store[key] = Received(message, at, waited)
