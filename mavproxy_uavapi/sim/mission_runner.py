"""AUTO's order of events: navigation items one after the other, immediate ones in between, conditions alongside.

What an item makes a vehicle do is its mode's business (`MissionMode`).
"""

from __future__ import annotations

from collections import deque

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from .events import Broadcast, ItemReached
from .mission import CONDITION, JUMPS, NAVIGATION, Item, State
from .mode import MissionMode
from .vehicle import EmbeddedVehicle

LONGEST_CHAIN = 100
"""Most items that one step runs through; a jump loop without a waypoint ends here."""
WORDS = """
NAV_WAYPOINT=WP NAV_SPLINE_WAYPOINT=SplineWP NAV_LOITER_UNLIM=LoitUnlim NAV_LOITER_TURNS=LoitTurns
NAV_LOITER_TIME=LoitTime NAV_LOITER_TO_ALT=LoitAltitude NAV_RETURN_TO_LAUNCH=RTL NAV_LAND=Land NAV_TAKEOFF=Takeoff
NAV_VTOL_TAKEOFF=VTOLTakeoff NAV_VTOL_LAND=VTOLLand NAV_DELAY=Delay NAV_SET_YAW_SPEED=SetYawSpd
NAV_CONTINUE_AND_CHANGE_ALT=ContinueAndChangeAlt DO_CHANGE_SPEED=ChangeSpeed DO_SET_SERVO=SetServo
DO_SET_HOME=SetHome DO_SET_REVERSE=SetReverse DO_LAND_START=LandStart NAV_PAYLOAD_PLACE=PayloadPlace DO_JUMP=Jump
JUMP_TAG=JumpTag DO_JUMP_TAG=JumpToTag CONDITION_DELAY=CondDelay CONDITION_DISTANCE=CondDist CONDITION_YAW=CondYaw
"""
NAMES = {
    getattr(mavlink, f"MAV_CMD_{command}"): name for command, name in (word.split("=") for word in WORDS.split())
}
"""What "Mission: 3 WP" calls the items."""


class MissionRunner:
    """Runs the mission of one vehicle from its marker on.

    With reports_all MISSION_ITEM_REACHED reports immediate items, too, and of several at once only the last one.
    """

    def __init__(self, vehicle: EmbeddedVehicle, flyer: MissionMode, *, reports_all: bool = False) -> None:
        self._vehicle = vehicle
        self._flyer = flyer
        self._reports_all = reports_all
        self._reached: int | None = None
        self._alongside: deque[tuple[int, Item]] = deque()
        self._begun_at = self._condition_since = 0.0
        self._seen_changes = 0
        self.waiting_to_start = True

    @property
    def item(self) -> Item:
        """The navigation item that is being flown."""
        mission = self._vehicle.mission
        return mission.items[mission.current]

    def stop(self) -> None:
        """AUTO is left; the mission can be resumed."""
        if self._vehicle.mission.state is State.RUNNING:
            self._vehicle.mission.state = State.STOPPED

    def step(self) -> None:
        """Start the mission, or see whether its item is done; once a control step."""
        if self.waiting_to_start:
            self._start_or_resume()
        elif self._vehicle.mission.state is State.RUNNING:
            self._watch_for_changes()
            self._update()
        if self._reports_all and self._reached is not None:
            self._vehicle.emit(ItemReached(self._reached))
        self._reached = None

    def _start_or_resume(self) -> None:
        """Begin at the first item, or where the mission was left (MIS_RESTART 0)."""
        vehicle, mission = self._vehicle, self._vehicle.mission
        self.waiting_to_start = False
        self._seen_changes = mission.changes
        if mission.state is not State.STOPPED or vehicle.parameters["MIS_RESTART"] == 1:
            mission.reset()
        mission.state = State.RUNNING
        self.run_from(max(mission.current, 1))

    def restart(self) -> None:
        """Begin again, unless it runs."""
        if self._vehicle.mission.state is not State.RUNNING:
            self.waiting_to_start = True

    def jump_to(self, seq: int) -> None:
        """Take up another current item, which the ground station chose while the mission runs."""
        self._vehicle.mission.state = State.RUNNING
        self.run_from(max(seq, 1))

    def _watch_for_changes(self) -> None:
        mission = self._vehicle.mission
        if mission.changes == self._seen_changes:
            return
        self._seen_changes = mission.changes
        if self._flyer.item_restarts():
            self._vehicle.say(mavlink.MAV_SEVERITY_CRITICAL, "Auto mission changed, restarted command")
            self.run_from(max(mission.current, 1))

    def run_from(self, seq: int) -> None:
        """Do immediate items from seq on and begin the first navigation item there."""
        mission = self._vehicle.mission
        self._alongside.clear()
        for _ in range(LONGEST_CHAIN):
            if seq >= len(mission.items):
                break
            item = mission.items[seq]
            if item.command in JUMPS:
                seq = self._jump(seq, item)
                continue
            if item.command in NAVIGATION:
                if self._begin(seq, item):
                    return
                seq += 1
                continue
            # What follows a condition waits for it; the next leg is flown meanwhile.
            if item.command in CONDITION or self._alongside:
                if not self._alongside:
                    self._start_condition(item)
                self._alongside.append((seq, item))
            else:
                self._do(seq, item)
            seq += 1
        mission.state, mission.in_landing_sequence = State.COMPLETE, False
        self._flyer.mission_ended()

    def _jump(self, seq: int, item: Item) -> int:
        """Where a jump leads; behind the last item if its target does not exist. A loop that is over counts anew."""
        mission = self._vehicle.mission
        target = self._target(item)
        if not 0 < target < len(mission.items):
            return len(mission.items)
        jumps_left = mission.jumps_left.setdefault(seq, int(item.param2))
        if jumps_left == 0:
            del mission.jumps_left[seq]
            return seq + 1
        if jumps_left > 0:
            mission.jumps_left[seq] = jumps_left - 1
        return target

    def _target(self, item: Item) -> int:
        """The number of the item that a jump leads to; 0 for none."""
        if item.command == mavlink.MAV_CMD_DO_JUMP:
            return int(item.param1)
        items = enumerate(self._vehicle.mission.items)
        tags = (seq for seq, one in items if one.command == mavlink.MAV_CMD_JUMP_TAG and one.param1 == item.param1)
        return next(tags, 0)

    def _announce(self, seq: int, item: Item) -> None:
        name = NAMES.get(item.command, f"Cmd {item.command}")
        self._vehicle.say(mavlink.MAV_SEVERITY_INFO, f"Mission: {seq} {name}")

    def _begin(self, seq: int, item: Item) -> bool:
        self._vehicle.mission.current, self._begun_at = seq, self._vehicle.now
        self._announce(seq, item)
        self._vehicle.emit(Broadcast("MISSION_CURRENT"))
        return self._flyer.begin_item(item)

    def _do(self, seq: int, item: Item) -> None:
        self._announce(seq, item)
        if item.command == mavlink.MAV_CMD_DO_SET_SERVO:
            self._vehicle.set_servo(int(item.param1), int(item.param2))
        self._flyer.do_item(item)
        self._reached = seq

    def _update(self) -> None:
        """Is the current item done, is a condition fulfilled?"""
        vehicle, mission = self._vehicle, self._vehicle.mission
        self._run_alongside()
        item = mission.items[mission.current]
        if not self._is_done(item) or mission.state is not State.RUNNING:
            return
        self._reached = mission.current
        if not self._reports_all:
            vehicle.emit(ItemReached(mission.current))
        self.run_from(mission.current + 1)

    def _is_done(self, item: Item) -> bool:
        if item.command == mavlink.MAV_CMD_NAV_DELAY:
            return self._vehicle.now - self._begun_at >= item.param1
        return self._flyer.item_done(item)

    def _holds(self, condition: Item) -> bool:
        if condition.command == mavlink.MAV_CMD_CONDITION_DELAY:
            return self._vehicle.now - self._condition_since >= condition.param1
        return self._flyer.condition_met(condition)

    def _start_condition(self, item: Item) -> None:
        self._condition_since = self._vehicle.now
        self._flyer.start_condition(item)

    def _run_alongside(self) -> None:
        while self._alongside:
            seq, item = self._alongside[0]
            if item.command in CONDITION:
                if not self._holds(item):
                    return
            else:
                self._do(seq, item)
            self._alongside.popleft()
            if self._alongside and self._alongside[0][1].command in CONDITION:
                self._start_condition(self._alongside[0][1])
