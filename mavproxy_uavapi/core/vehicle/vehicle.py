"""The verbs that every type of vehicle has, as far as ArduPilot has them in common."""

from __future__ import annotations

import contextlib
import math
from typing import Any

from mavproxy_uavapi.core.control.authority import Rank
from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import (
    Busy,
    ModeChanged,
    NotArmed,
    NotFound,
    NotSupported,
    Rejected,
    Superseded,
    TimedOut,
)
from mavproxy_uavapi.core.link import messages
from mavproxy_uavapi.core.mission.list_transfers import RALLY
from mavproxy_uavapi.core.mission.mission_files import MissionItem
from mavproxy_uavapi.core.mission.mission_legs import WANTED
from mavproxy_uavapi.core.mission.mission_way import landing_places
from mavproxy_uavapi.core.telemetry.flight_modes import STOPPING_MODES, flies_mission, mode_names, mode_number
from mavproxy_uavapi.core.telemetry.readings import HomePlace
from mavproxy_uavapi.core.vehicle import arming
from mavproxy_uavapi.core.vehicle.touchdown import Touchdown
from mavproxy_uavapi.core.vehicle.verbs import Verbs

NO_LIST = "MAV_MISSION_UNSUPPORTED"  # the answer of a firmware without rally points
HOME_RADIUS = 10.0  # m; closer than this a vehicle on the ground is at home


class Vehicle(Verbs):
    """One vehicle, and the verbs that all types have.

    Verbs raise errors of `errors.py`: `Rejected` when the autopilot refuses, `TimedOut`, `LinkLost`,
    `ModeChanged` when the pilot or a failsafe takes the vehicle, `Busy` and `NotArmed` when its state
    forbids the verb; then nothing has been sent.
    """

    async def arm(self, job: Job, timeout: float | None = None) -> None:
        """Wait until it is ready, switch to GUIDED, arm, and wait until it is armed.

        A vehicle that flies, or a rover that drives, in another mode than GUIDED belongs to its pilot: `ModeChanged`.
        So does one that is armed by another client meanwhile.

        Raises:
            Rejected: it did not get ready, or refused; with the autopilot's reasons.
        """
        await self.command(job).resumed()
        if self.state.armed and self.mode == "GUIDED":
            self.authority.admit(Rank.ARM)
            return
        if self.is_under_way:
            raise self.anothers()
        self.authority.take(job, Rank.ARM)
        await arming.arm(self, job, timeout)
        await self.know_for_airspace()  # arming has moved home
        self.held_by("GUIDED")  # somebody may have disarmed it meanwhile
        self.command(job).confirm()

    async def disarm(self, job: Job, force: bool = False) -> None:
        """Disarm and wait until a heartbeat shows it. In flight it is refused, unless `force`: then it falls.

        It ends an `arm` that waits. It is sent to a disarmed vehicle, too: somebody may have armed it since its last
        heartbeat.
        """
        if self.state.armed is not False and not force and self.state.landed is False:
            raise Busy("the vehicle is flying; land it first (force=true stops its motors in the air)")
        await self.command(job).take(Rank.FORCE if force else Rank.STOP)
        await arming.disarm(self, job, force)
        self.command(job).confirm()

    async def stays_disarmed(self, job: Job) -> bool:
        """Whether it is disarmed, by a heartbeat that is newer than the call.

        If our order to arm may be on its way, it is undone first.

        Raises:
            ModeChanged: the heartbeat shows it armed.
            TimedOut, LinkLost: no heartbeat comes.
        """
        if self.state.armed is not False:
            return False
        if self.arm_is_on_its_way:
            await arming.disarm(self, job, force=False)
        else:
            await self.wait_for_heartbeat()
        self.require_disarmed()
        return True

    def require_disarmed(self) -> None:
        """Raise ModeChanged unless it is disarmed: a vehicle that somebody else has armed is theirs."""
        if self.state.armed is not False:
            raise ModeChanged(f"the pilot or another client has armed the vehicle, in {self.mode}")

    async def end_waiting_arm(self, job: Job) -> None:
        """End an `arm` of ours that has not shown its effect, for a verb that stops the vehicle."""
        if not self.state.armed and (self.authority.on_its_way or self.arm_is_on_its_way):
            await self.command(job).take(Rank.STOP)
            if self.arm_is_on_its_way:
                await arming.disarm(self, job, force=False)

    async def set_mode(self, job: Job, mode: str) -> None:
        """Switch to any mode of the vehicle's type. A mode that stops it has the higher rank.

        Raises:
            OutsideEnvelope: its mission leaves the envelope, or in that mode nobody keeps it inside.
        """
        switch = messages.set_mode(mode_number(self.state.vehicle_type, mode))
        if flies_mission(mode.upper()) and not self.guard.in_force:
            self.landing_items = None  # it is not read
        elif flies_mission(mode.upper()):
            since = self.state.mode_since
            items = await self.mission_to_fly(job)
            starts = self.guard.starts(items, mode.upper())
            await self.guard.look_at_mission(items, from_here=True, starts=starts)
            self.guard.require_mission(items, from_here=True, starts=starts)
            await self.confirm_own_mode(job, since)
        stops = mode.upper() in STOPPING_MODES.union(self.holding_modes)
        await self.command(job).take(Rank.STOP if stops else Rank.ARM, self.inside(switch))
        if stops and self.arm_is_on_its_way:
            await arming.disarm(self, job, force=False)
        await self.command(job).switch_mode(mode)
        await self._finish_switch(job, mode.upper())
        self.command(job).confirm()

    async def _finish_switch(self, job: Job, mode: str) -> None:
        """Do what a switch to that mode needs besides."""

    async def mission_to_fly(self, job: Job) -> list[MissionItem]:
        """The stored mission, for a verb that then takes the vehicle.

        Raises:
            Busy: it is not the verb's turn.
            Superseded: another job has taken it meanwhile, by a newer command.
            Rejected, TimedOut, LinkLost.
        """
        self.authority.require_turn(job, Rank.ARM)  # now, not when the mission has been read and checked
        commander = self.authority.commander
        _, items = await self.waypoints.download()
        if self.authority.commander is not commander:
            raise Superseded("a newer command took the vehicle while its mission was read")
        if self.guard.in_force:
            await self.learn_rally()
            await self.parameters.read(WANTED.get(self.kind, []))
            with contextlib.suppress(NotFound, TimedOut):  # a mission that needs it is refused then
                await self.know_home()
        self._note_landings(items)
        return items

    async def learn_rally(self) -> None:
        """Read its rally points; no message tells that another station has changed them.

        Raises:
            Rejected: another station transfers them now.
            Busy, TimedOut, LinkLost.
        """
        try:
            self.guard.check.rally = await self.waypoints.read_list(RALLY)
        except Rejected as error:
            if error.ack != NO_LIST:
                raise

    async def learn_mission(self) -> None:
        """Read the mission that it began unread: where it lands, and its way from here.

        Raises:
            Rejected, Busy, TimedOut, LinkLost.
        """
        items = (await self.waypoints.read())[1]
        self._note_landings(items)
        await self.guard.follow(items)

    def _note_landings(self, items: list[MissionItem]) -> None:
        self.landing_items = landing_places(items, self.kind, self.guard.check.home())

    async def confirm_own_mode(self, job: Job, since: float) -> None:
        """Let a late job wait for a heartbeat before it switches the mode: the pilot may have switched it meanwhile.

        Raises:
            ModeChanged: as `require_own_mode`.
            TimedOut, LinkLost: no heartbeat comes.
        """
        if job.is_late:
            await self.wait_for_heartbeat()
        self.require_own_mode(since)

    # -- stopping -----------------------------------------------------------------------------------------

    async def end_stop(self, job: Job, mode: str) -> None:
        """Let a vehicle go on that `stop` holds in `mode`, unless it is stopped again meanwhile."""
        await self.command(job).send(messages.pause(False), lambda: self.require_mode(mode))
        if job is not self.authority.interrupted:
            self.authority.end_pause()

    @property
    def stops_in_its_mode(self) -> bool:
        """Whether `hold` switches no mode."""
        return False

    async def hold(self, job: Job) -> None:
        """Stop and stay, whatever movement of ours it flies."""
        await self._switch_to_hold(job)
        self.command(job).confirm()

    async def _switch_to_hold(self, job: Job) -> None:
        """Switch to the holding mode; it may still move then. One that is disarmed meanwhile needs no hold."""
        await self.command(job).take(Rank.STOP)
        was_armed = self.state.armed

        def still_armed() -> None:
            if was_armed and self.state.armed is False:
                raise NotArmed("the vehicle was disarmed meanwhile")

        if not self.mode == self.next_mode == self.holding_mode:
            await self.command(job).switch_mode(self.holding_mode, still_armed)

    async def land_or_return(self, job: Job) -> None:
        """Land after the end of a flight, by the means of its type: RTL, or else its holding mode."""
        await self.set_mode(job, "RTL" if "RTL" in mode_names(self.state.vehicle_type) else self.holding_mode)

    def hold_message(self) -> Any:
        """The one message that makes it hold, for the end of the module."""
        return messages.set_mode(mode_number(self.state.vehicle_type, self.holding_mode)).to(self.address, 0)

    # -- home ---------------------------------------------------------------------------------------------

    async def is_done_at_home(self, job: Job) -> bool:
        """Whether it is disarmed at home, so that a return is done already.

        Raises:
            NotArmed: it is disarmed elsewhere.
            NotFound: it is disarmed, and has no home yet.
            ModeChanged: it was armed while we requested its home.
            TimedOut, LinkLost: as `stays_disarmed`.
        """
        if not await self.stays_disarmed(job):
            return False
        distance = self.distance_home()
        if distance is None:
            await self.home()
            self.require_disarmed()
            self.position()
            distance = self.distance_home() or 0.0
        if distance > HOME_RADIUS:
            raise NotArmed(f"the vehicle is disarmed, {distance:.0f} m from home")
        return True

    async def landed_in(self, job: Job, mode: str, timeout: float) -> None:
        """Wait until it has landed and disarmed in that mode; motors that stop in flight are no landing."""
        landing = Touchdown(await self.limits())

        def landed() -> bool | None:
            self.report_home(job)
            return self.has_landed(landing, mode)

        names = {"HEARTBEAT", "GLOBAL_POSITION_INT"}
        await self.waiting.until(names, landed, timeout, f"land and disarm in {mode}")

    def has_landed(self, landing: Touchdown, *modes: str) -> bool | None:
        """Whether it has landed and disarmed in one of the modes; called after each heartbeat and position.

        Raises:
            NotArmed: its motors stopped in flight.
            ModeChanged: the pilot or a failsafe has the vehicle.
        """
        position = self.state.position
        north, east, down = (0.0, 0.0, 0.0) if position is None else position.velocity
        landing.moves_at(down, math.hypot(north, east))
        if self.state.armed is not False or self.mode not in modes:
            self.held_by(self.mode if self.mode in modes else modes[0])
            return None
        landing.disarmed(self.clock())
        if landing.fell:
            raise NotArmed("the vehicle was disarmed in flight, and fell")
        if self.waiting.listening.is_behind:  # its positions wait in MAVProxy
            return None
        return landing.is_over(self.clock(), self.state.age("GLOBAL_POSITION_INT", self.clock()))

    def report_home(self, job: Job) -> None:
        """Set the job's progress: the altitude, and the distance to home."""
        job.progress = {"altitude": self.height}
        distance = self.distance_home()
        if distance is not None:
            job.progress["distance_to_go"] = distance

    async def set_speed(self, job: Job, kind: str, speed: float) -> bool:
        """Set the `kind` of speed (air, ground, climb, descent) to `speed` m/s; the ack is the proof.

        Returns:
            Whether it is in force now; else it is remembered until the vehicle flies in GUIDED. 0 is no speed to fly
            at, so it is never remembered: the autopilot takes or refuses it now.
        """
        change = messages.change_speed(kind, speed)
        self.authority.accompany(job, f"{kind} speed", stopped_too=True, allow=self.inside(change))
        if speed == 0:
            await self.command(job).send(change)
            return True
        if not self.takes_speeds:
            self.speeds.remember(kind, speed)
            return False
        try:
            await self.command(job).send(change, self._require_speeds)
        except (ModeChanged, Rejected):
            if self.takes_speeds:
                raise
            self.speeds.remember(kind, speed)
            return False
        self.speeds.take(kind, speed)
        return True

    @property
    def takes_speeds(self) -> bool:
        """Whether its autopilot takes a speed in the mode that it is in."""
        return True

    def _require_speeds(self) -> None:
        if not self.takes_speeds:
            raise ModeChanged(f"the vehicle is in {self.mode} now, which takes no speed")

    async def set_home(self, job: Job) -> None:
        """Make the current position home; the command is repeated while the estimator settles."""
        order = messages.set_home_here()
        self.authority.accompany(job, "home", Rank.ARM, allow=self.inside(order))
        await self.command(job).send(order)
        await self.home()

    async def know_home(self) -> None:
        """Request HOME_POSITION, unless it was heard since the last boot.

        Raises:
            NotFound, TimedOut, LinkLost: as `home`.
        """
        if self.state.home is None:
            await self.home()

    async def home(self) -> HomePlace:
        """Request its home.

        Raises:
            NotFound: the vehicle has no home yet.
        """
        try:
            return HomePlace.of(await self.request("HOME_POSITION"))
        except Rejected as error:
            raise NotFound(f"the vehicle has no home position yet ({error.ack})") from error

    async def set_servo(self, channel: int, pwm: int) -> None:
        """Set servo output `channel` (from 1) to `pwm` microseconds."""
        await self.ask(messages.set_servo(channel, pwm))

    async def set_sim_speedup(self, factor: float) -> None:
        """Set SIM_SPEEDUP and read it back.

        Raises:
            NotSupported: the vehicle has no such parameter: it is no simulation.
        """
        name = "SIM_SPEEDUP"
        if not await self.parameters.read([(name,)]):
            raise NotSupported("the vehicle is not a simulation: it has no parameter SIM_SPEEDUP")
        value = await self.parameters.set(name, factor)
        if not math.isclose(value, factor, rel_tol=1e-5):
            raise TimedOut(f"vehicle {self.state.system} did not take {name} = {factor:g}: it is {value:g}")
