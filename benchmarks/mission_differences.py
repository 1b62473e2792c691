"""Random missions, as they are predicted and as they are flown.

    python benchmarks/mission_differences.py --missions 200 [--seed N] [--vehicle rover] [--ardupilot ~/ardupilot]

It makes missions of the items that the vehicle's type takes (heights of 0, frames, jumps, tags, circles, landings,
markers and what the type passes over), predicts their legs (`mission_way.route`), and flies them on the embedded
vehicle, or with `--ardupilot` on its SITL. A mission differs if the vehicle was farther than BESIDE from each leg,
did not come within AT of the end of a leg that is always flown, was faster than its legs by more than FASTER, or
stayed elsewhere; for a plane, which begins in the air, WP_LOITER_RAD farther. Each difference is printed with its
seed, which `--seed N --missions 1` flies again.

Each mission of a copter or rover is also held against a field with a mast, and a copter's against another copter that
hovers somewhere: how many of the accepted ones, which nobody stops here, come outside or too near, and how many of
the refused ones would have been fine.
"""

from __future__ import annotations

import argparse
import contextlib
import math
import random
import signal
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path as FilePath
from typing import Any

sys.path.insert(0, str(FilePath(__file__).parents[1]))

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from sim_pair import BINARIES, DEFAULTS, MODELS, running
from sim_station import HOME, Station, place

from mavproxy_uavapi.core.airspace import cruise, formats
from mavproxy_uavapi.core.airspace.envelope_check import MissionQuestion, answer
from mavproxy_uavapi.core.airspace.forecast import Pace, Path, along_path, gaps_between, near_miss
from mavproxy_uavapi.core.airspace.local_frame import LocalFrame, Spot
from mavproxy_uavapi.core.airspace.space import Space, outside_by
from mavproxy_uavapi.core.airspace.speeds import Speeds
from mavproxy_uavapi.core.airspace.traffic import MARGIN, PLANNED
from mavproxy_uavapi.core.errors import OutsideEnvelope
from mavproxy_uavapi.core.mission import mission_legs, mission_way
from mavproxy_uavapi.core.mission.mission_files import HOME as HOME_ITEM
from mavproxy_uavapi.core.mission.mission_files import MissionItem
from mavproxy_uavapi.core.mission.mission_legs import MissionRoute, PathPoint, Setting
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState
from tests.support.envelopes import field
from tests.support.own_vehicle import OwnVehicle

BESIDE, AT, STAYS, FASTER = 5.0, 5.0, 5.0, 1.5  # m, and m/s
SEPARATION = 8.0  # m from another copter, which hovers
OUT = 3.0  # m outside of FIELD, in which the watch trusts the autopilot in a mission; nobody watches here
HALF = {"copter": 60.0, "rover": 60.0, "plane": 500.0}  # m: places lie in a square of twice that
HEIGHTS = {"copter": (8, 25), "rover": (8, 25), "plane": (60, 110)}
REL, AMSL = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL
GUIDED, LAND, TAKEOFF = {"copter": 4, "rover": 15, "plane": 15}, 9, 13
SPEEDS = (
    "WPNAV_SPEED", "WPNAV_SPEED_UP", "WPNAV_SPEED_DN", "WP_SPD", "WP_SPD_UP", "WP_SPD_DN", "WP_SPEED", "CRUISE_SPEED",
    "AIRSPEED_CRUISE", "TRIM_ARSPD_CM",
)  # fmt: skip

FIELD = Space(formats.of_geojson(field(75.0, 35.0), "the envelope"))  # with a mast; planes are not held against it
Cmd = mavlink
CIRCLES = {
    "copter": (Cmd.MAV_CMD_NAV_LOITER_TURNS,),
    "rover": (),
    "plane": (
        Cmd.MAV_CMD_NAV_LOITER_TURNS,
        Cmd.MAV_CMD_NAV_LOITER_TIME,
        Cmd.MAV_CMD_NAV_LOITER_TO_ALT,
        Cmd.MAV_CMD_NAV_LOITER_UNLIM,
        Cmd.MAV_CMD_NAV_RETURN_TO_LAUNCH,
    ),
}
GROUND = 1.0  # m; lower than this a copter counts as landed
ROUNDS = 60.0  # s for which a plane is watched at the end of its mission
HEARD = {
    "GLOBAL_POSITION_INT": 100_000,
    "LOCAL_POSITION_NED": 200_000,
    "MISSION_CURRENT": 200_000,
    "VFR_HUD": -1,
    "SYS_STATUS": -1,
    "EKF_STATUS_REPORT": -1,
    "EXTENDED_SYS_STATE": -1,
}  # us between two; each message takes time here
# One IMU, which needs those of the others to be blank; no log, no terrain: the same flight by less processor time.
LESS = {"LOG_BACKEND_TYPE": 0, "EK2_ENABLE": 0, "EK3_IMU_MASK": 1, "SIM_IMU_COUNT": 1, "TERRAIN_ENABLE": 0}
LESS |= {f"INS_ACC{other}OFFS_{axis}": 0 for other in (2, 3) for axis in "XYZ"}
LESS |= {f"INS_ACC{other}SCAL_{axis}": 1 for other in (2, 3) for axis in "XYZ"}
LATE = (mavlink.MAV_MISSION_OPERATION_CANCELLED, mavlink.MAV_MISSION_ERROR, mavlink.MAV_MISSION_INVALID_SEQUENCE)


def item(
    command: int, *params: float, at: tuple[float, float] | None = None, z: float = 0.0, frame: int = REL
) -> Any:
    lat, lon = (0.0, 0.0) if at is None else place(*at)
    four = (*params, *([0.0] * (4 - len(params))))
    return MissionItem(command, frame, four, round(lat * 1e7), round(lon * 1e7), float(np.float32(z)))


class Dice(random.Random):
    """Draws missions of one type of vehicle."""

    kind = "copter"

    def somewhere(self) -> tuple[float, float]:
        half = HALF[self.kind]
        return self.uniform(-half, half), self.uniform(-half, half)

    def height(self) -> tuple[float, int]:
        """A height and its frame; often none."""
        if self.random() < 0.3:
            return 0.0, self.choice([REL, AMSL])
        up = self.uniform(*HEIGHTS[self.kind])
        return (up + HOME[2], AMSL) if self.random() < 0.3 else (up, REL)

    def leg(self, command: int, *params: float) -> MissionItem:
        z, frame = self.height()
        here = None if self.random() < 0.1 else self.somewhere()
        keeps = frame == REL and (here is None or command != Cmd.MAV_CMD_NAV_WAYPOINT)
        if self.kind == "plane" and not z and not keeps:  # 0 is the ground, or the sea
            z, frame = self.uniform(*HEIGHTS["plane"]), REL
        return item(command, *params, at=here, z=z, frame=frame)

    def marker(self) -> MissionItem:
        """What moves nothing, though it may have a place."""
        command = self.choice([Cmd.MAV_CMD_DO_LAND_START, Cmd.MAV_CMD_DO_SET_ROI_LOCATION, Cmd.MAV_CMD_DO_GO_AROUND])
        if self.random() < 0.3:
            return item(Cmd.MAV_CMD_CONDITION_YAW, self.uniform(0, 359), 30, 1)
        return item(command, at=self.somewhere(), z=10)

    def copter_item(self) -> MissionItem:
        skipped = self.choice([Cmd.MAV_CMD_NAV_SET_YAW_SPEED, Cmd.MAV_CMD_NAV_CONTINUE_AND_CHANGE_ALT])
        return self._one_of(
            (7, self.leg(Cmd.MAV_CMD_NAV_WAYPOINT, self.choice([0, 0, 1, 3]))),
            (2, self.leg(Cmd.MAV_CMD_NAV_LOITER_TIME, self.choice([0, 2]))),
            (2, self.leg(Cmd.MAV_CMD_NAV_LOITER_TURNS, self.choice([1, 2, 0.5]), 0, self.choice([0, 6, -9, 12]))),
            (2, item(Cmd.MAV_CMD_NAV_LOITER_TO_ALT, at=self.somewhere(), z=self.uniform(6, 20))),
            (1, item(Cmd.MAV_CMD_NAV_DELAY, self.choice([1, 2]), -1, -1, -1)),
            (1, item(Cmd.MAV_CMD_DO_CHANGE_SPEED, 1, self.uniform(3, 8), -1)),
            (1, item(skipped, 1, 2)),
            (1, item(Cmd.MAV_CMD_NAV_PAYLOAD_PLACE, self.uniform(1, 4), at=self.somewhere(), z=3)),
            (3, self.marker()),
        )

    def rover_item(self) -> MissionItem:
        skipped = self.choice([Cmd.MAV_CMD_NAV_LAND, Cmd.MAV_CMD_NAV_TAKEOFF, Cmd.MAV_CMD_NAV_LOITER_TO_ALT])
        return self._one_of(
            (10, self.leg(Cmd.MAV_CMD_NAV_WAYPOINT, self.choice([0, 0, 1]))),
            (2, item(Cmd.MAV_CMD_NAV_LOITER_TIME, 1, at=self.somewhere())),
            (2, item(skipped, at=self.somewhere(), z=10)),
            (1, item(Cmd.MAV_CMD_NAV_RETURN_TO_LAUNCH)),
            (1, item(Cmd.MAV_CMD_NAV_DELAY, 1, -1, -1, -1)),
            (3, self.marker()),
        )

    def plane_item(self) -> MissionItem:
        skipped = self.choice([Cmd.MAV_CMD_NAV_DELAY, Cmd.MAV_CMD_NAV_VTOL_TAKEOFF, Cmd.MAV_CMD_NAV_PAYLOAD_PLACE])
        return self._one_of(
            (8, self.leg(Cmd.MAV_CMD_NAV_WAYPOINT, 0, 0, self.choice([0, 0, 40]))),
            (2, self.leg(Cmd.MAV_CMD_NAV_LOITER_TIME, self.choice([0, 10]))),
            (2, self.leg(Cmd.MAV_CMD_NAV_LOITER_TURNS, self.choice([1, 2]), 0, self.choice([0, 60, -90]))),
            (
                2,
                item(
                    Cmd.MAV_CMD_NAV_LOITER_TO_ALT,
                    0,
                    self.choice([0, 70]),
                    at=self.somewhere(),
                    z=self.uniform(60, 110),
                ),
            ),
            (1, item(Cmd.MAV_CMD_DO_CHANGE_SPEED, 0, self.uniform(16, 26), -1)),
            (1, item(skipped, 1, 2)),
            (3, self.marker()),
        )

    def _one_of(self, *chances: tuple[int, MissionItem]) -> MissionItem:
        return self.choices([drawn for _, drawn in chances], [weight for weight, _ in chances])[0]

    def odd_item(self) -> MissionItem:
        """What planners seldom write, and hands and programs do; a copter's."""
        speed = self.choice([(0, 4), (1, 0), (1, -1), (1, -2), (2, 1), (3, 1), (1, 3.999), (4, 5)])
        up, frame = self.choice([(20.0, 6), (20.0 + HOME[2], 5), (0.004, 3), (0.01, 3), (-0.5, 3), (0.0, 5)])
        near = round(self.uniform(-2, 2), 1), round(self.uniform(-2, 2), 1)
        turns = self.choice([0, 0.25, 1.5, 2.9]), 0, self.choice([0, 5.9, 300, -300])
        return self._one_of(
            (3, item(Cmd.MAV_CMD_DO_CHANGE_SPEED, *speed)),
            (4, item(Cmd.MAV_CMD_NAV_WAYPOINT, self.choice([0, 0.4, 2]), at=self.somewhere(), z=up, frame=frame)),
            (2, item(Cmd.MAV_CMD_NAV_WAYPOINT, 0, self.choice([0, 30, 255])))
            if self.random() < 0.5
            else (2, item(Cmd.MAV_CMD_NAV_WAYPOINT, at=near, z=10)),
            (3, item(Cmd.MAV_CMD_NAV_TAKEOFF, at=self.choice([None, self.somewhere()]), z=self.uniform(5, 25))),
            (2, item(Cmd.MAV_CMD_NAV_LOITER_TURNS, *turns, at=self.choice([None, self.somewhere()]))),
            (2, item(Cmd.MAV_CMD_NAV_LOITER_TO_ALT, at=self.choice([None, near]), z=self.choice([5, 25]))),
            (1, item(Cmd.MAV_CMD_NAV_LAND, at=self.choice([None, self.somewhere()]), z=self.choice([0, 10]))),
            (1, item(Cmd.MAV_CMD_NAV_VTOL_LAND, at=self.somewhere())),
            (1, item(Cmd.MAV_CMD_NAV_RETURN_TO_LAUNCH, at=self.somewhere(), z=20)),
            (1, item(Cmd.MAV_CMD_NAV_DELAY, 0.3)),
            (1, item(Cmd.MAV_CMD_CONDITION_DELAY, 3)),
            (1, item(Cmd.MAV_CMD_CONDITION_DISTANCE, 20)),
            (2, item(Cmd.MAV_CMD_DO_JUMP, self.randint(0, 9), self.choice([0, 1, 1.9]))),
            (2, item(Cmd.MAV_CMD_DO_JUMP_TAG, self.choice([5, 6]), self.choice([0, 1]))),
            (2, item(Cmd.MAV_CMD_JUMP_TAG, 5)),
            (1, item(188, at=self.somewhere(), z=10)),
        )

    def odd_mission(self) -> list[MissionItem]:
        """Half of the items are odd."""
        whole = self.mission("copter")
        for _ in range(self.randint(2, 5)):
            whole.insert(self.randint(1, len(whole)), self.odd_item())
        return whole

    def mission(self, kind: str) -> list[MissionItem]:
        self.kind = kind
        draw = {"copter": self.copter_item, "rover": self.rover_item, "plane": self.plane_item}[kind]
        items = [draw() for _ in range(self.randint(3, 7))]
        if self.random() < 0.3:
            tag = self.randint(0, len(items) - 1)
            items.insert(tag, item(Cmd.MAV_CMD_JUMP_TAG, 5))
            items.append(item(Cmd.MAV_CMD_DO_JUMP_TAG, 5, self.randint(0, 2)))
        elif self.random() < 0.3:
            items.append(item(Cmd.MAV_CMD_DO_JUMP, self.randint(2, len(items) + 1), self.randint(0, 2)))
        if kind == "rover":
            return items
        if kind == "plane":
            glide = [self.leg(16), item(Cmd.MAV_CMD_NAV_LAND, at=self.somewhere())]
            last = [[], [], [item(Cmd.MAV_CMD_NAV_RETURN_TO_LAUNCH)], [item(Cmd.MAV_CMD_NAV_LOITER_UNLIM)], glide]
            return [*items, *self.choice(last)]
        first = item(Cmd.MAV_CMD_NAV_TAKEOFF, at=self.choice([None, self.somewhere()]), z=self.uniform(6, 15))
        ends = [item(Cmd.MAV_CMD_NAV_LAND), item(Cmd.MAV_CMD_NAV_LAND, at=self.somewhere(), z=0)]
        ends += [item(Cmd.MAV_CMD_NAV_RETURN_TO_LAUNCH), item(Cmd.MAV_CMD_NAV_LOITER_UNLIM), self.leg(16)]
        return [first, *items, self.choice(ends)]


class Flights:
    """Flies missions on one vehicle, one after another.

    Attributes:
        inside: whether the last one is predicted to stay in FIELD.
        outside: how far (m) it was outside.
        apart: whether it is predicted to keep away from another copter, which hovers at `other`.
        nearest: how near (m) it came to that one in the air.
    """

    def __init__(self, station: Station, kind: str) -> None:
        self.station, self.kind = station, kind
        self._stays_at, self._stands_since = -1, 0.0
        self.inside, self.outside = False, 0.0
        self.apart, self.nearest, self.other = False, math.inf, Spot(0.0, 0.0, 0.0)
        self._frame = LocalFrame(HOME[:2])
        lat, lon = (round(degrees * 1e7) for degrees in HOME[:2])
        station.send.command_int_send(1, 1, AMSL, Cmd.MAV_CMD_DO_SET_HOME, 0, 0, 0, 0, 0, 0, lat, lon, HOME[2])
        station.send.request_data_stream_send(1, 1, mavlink.MAV_DATA_STREAM_ALL, 0, 0)
        for name, interval in HEARD.items():
            number = getattr(mavlink, f"MAVLINK_MSG_ID_{name}")
            station.command(Cmd.MAV_CMD_SET_MESSAGE_INTERVAL, number, interval)
        station.wait(lambda: "GLOBAL_POSITION_INT" in station.last)
        self._radius = 0.0
        wanted = [*(name for names in mission_legs.WANTED[kind] for name in names), *SPEEDS]
        self.parameters = {name: self._parameter(name) for name in wanted}
        self.parameters = {name: value for name, value in self.parameters.items() if value is not None}
        if kind == "plane":
            self._radius = abs(self.parameters["WP_LOITER_RAD"])

    def _parameter(self, name: str) -> float | None:
        self.station.last.pop("PARAM_VALUE", None)
        self.station.send.param_request_read_send(1, 1, name.encode(), -1)
        self.station.run(1.0)
        answer = self.station.last.get("PARAM_VALUE")
        return float(answer.param_value) if answer is not None and answer.param_id == name else None

    def here(self) -> PathPoint:
        at = self.station.last["GLOBAL_POSITION_INT"]
        return PathPoint(at.lat / 1e7, at.lon / 1e7, 0.0 if self.kind == "rover" else at.relative_alt / 1000)

    def _setting(self) -> Setting:
        pace = cruise.pace(self.kind, self.parameters, Speeds(VehicleState(1, 1, 0, 0.0)))
        return Setting(
            self.kind,
            self.here(),
            HOME[:2],
            HOME[2],
            self._radius,
            fastest=cruise.over_ground(self.kind, pace),
            slowest=pace,
            parameters=self.parameters,
        )

    def predicted(self, items: list[MissionItem]) -> MissionRoute:
        setting = self._setting()
        try:
            answer(MissionQuestion(items, setting, (1,), (FIELD,)))
            self.inside = True
        except OutsideEnvelope:
            self.inside = False
        way = mission_way.route(items, setting)
        self.apart = not (way.legs and self._meets(way))
        return way

    def _meets(self, way: MissionRoute) -> bool:
        """Whether a mission would be refused because of the other copter."""
        kept, path = SEPARATION + MARGIN, way.way()[0].in_frame(self._frame)
        forecast = along_path(path, PLANNED, kept)
        stays = along_path(Path.through([self.other], Pace(1.0, 1.0, 1.0)), PLANNED, kept)
        return near_miss(forecast.at_any_time() if way.loops else forecast, stays, kept) is not None

    def fly(self, items: list[MissionItem], longest: float) -> list[tuple[Any, float]]:
        """Fly a mission; the places where the vehicle was, and its speeds (m/s)."""
        station = self.station
        assert station.armed or station.wait(lambda: station.arm() == 0, 60.0) < 60, station.texts[-5:]
        assert station.command(Cmd.MAV_CMD_MISSION_START) == 0, station.texts[-5:]
        track: list[tuple[Any, float]] = []
        began, seen = station.at, None
        endless = [Cmd.MAV_CMD_NAV_LOITER_UNLIM, *([Cmd.MAV_CMD_NAV_RETURN_TO_LAUNCH] * (self.kind == "plane"))]
        stays = items[-1].command in endless
        self._stays_at, self._stands_since = len(items) if stays else -1, 0.0
        while station.at - began < longest and not self._is_over(station.at - began):
            station.hear()
            at = station.last["GLOBAL_POSITION_INT"]
            if at is not seen:
                seen, here = at, self.here()
                track.append((self._frame.spot(here[:2], here.up), math.hypot(at.vx, at.vy) / 100))
        return track

    def _is_over(self, seconds: float) -> bool:
        station = self.station
        mission = station.last["MISSION_CURRENT"]
        if self.kind == "plane":
            complete = mission.mission_state == mavlink.MISSION_STATE_COMPLETE or mission.seq == self._stays_at
            self._stands_since = self._stands_since if complete else seconds
            return seconds > 5 and (seconds - self._stands_since > ROUNDS or not station.armed)
        complete = mission.mission_state == mavlink.MISSION_STATE_COMPLETE or mission.seq == self._stays_at
        self._stands_since = self._stands_since if complete and station.speed < 0.2 else seconds
        return seconds > 5 and (seconds - self._stands_since > 3 or not station.armed)

    def _upload(self, items: list[MissionItem]) -> None:
        """Hand a mission over; on a busy machine the vehicle, whose time runs fast, may give up waiting."""
        for _ in range(10):
            answer = self._hand_over([HOME_ITEM, *items])
            if answer == mavlink.MAV_MISSION_ACCEPTED:
                return
            assert answer in LATE, answer
            self.station.run(9)  # until it gives the upload up
        raise AssertionError("the vehicle takes no mission")

    def _hand_over(self, everything: list[MissionItem]) -> int:
        station, following = self.station, 0
        station.last.pop("MISSION_ACK", None)
        station.send.mission_count_send(1, 1, len(everything), 0)
        while "MISSION_ACK" not in station.last:
            station.last.pop("MISSION_REQUEST", None)
            station.hear()
            request = station.last.get("MISSION_REQUEST")
            if request is not None and request.seq >= following:
                following = request.seq + 1
                station.send.send(everything[request.seq].to((1, 1), request.seq))
        return int(station.last["MISSION_ACK"].type)

    def prepare(self, items: list[MissionItem]) -> None:
        """Bring the vehicle to where a mission begins, and hand it over."""
        station = self.station
        self.land_or_return()
        station.mode(GUIDED[self.kind])
        self._upload(items)
        station.command(Cmd.MAV_CMD_DO_SET_MISSION_CURRENT, 1, 1)
        station.run(1)

    def land_or_return(self) -> None:
        station = self.station
        if self.kind == "rover":
            station.mode(GUIDED["rover"])
            station.run(1)
        elif self.kind == "plane":
            if not station.armed:
                station.command(Cmd.MAV_CMD_DO_SET_MISSION_CURRENT, 1, 1)  # it arms in no landing
                station.send.mission_clear_all_send(1, 1, 0)
                station.mode(TAKEOFF)
                assert station.wait(lambda: station.arm() == 0, 60.0) < 60, station.texts[-5:]
                station.wait(lambda: station.height > 45, 120.0)
            station.mode(GUIDED["plane"])
            station.reposition(0, 0, 80)
            station.wait(lambda: station.away(0, 0) < 1.5 * self._radius, 200.0)
        elif self.station.armed:
            self.station.mode(LAND)
            self.station.wait(lambda: not self.station.armed, 180)
        self.station.run(1)

    def differences(self, items: list[MissionItem]) -> list[str]:
        """What differs; empty for a mission that is flown as predicted."""
        self.prepare(items)
        way = self.predicted(items)
        if not way.legs:
            return []
        length = sum(math.dist(self._spot(leg.begin), self._spot(leg.end)) for leg in way.legs)
        slowly = (3 if way.loops else 1.5) / (10 if self.kind == "plane" else 1)
        track = self.fly(items, 90 + length * slowly + (60 if self.kind == "plane" else 15) * len(items))
        begins = np.array([self._spot(leg.begin) for leg in way.legs])
        ends = np.array([self._spot(leg.end) for leg in way.legs])
        spots = [np.array([spot]) for spot, _ in track]
        shift = FIELD.frame(HOME[:2]).metres(HOME[:2])
        rules = FIELD.rules(None, on_ground=self.kind == "rover")
        self.outside = max(outside_by(Spot(at[0] + shift[0], at[1] + shift[1], at[2]), rules) for at, _ in track)
        flown = np.array([at for at, _ in track if at[2] > GROUND] or [(math.inf,) * 3])
        there = np.array([self.other])
        self.nearest = float(gaps_between(there, there, flown[:-1], flown[1:]).min(initial=math.inf))
        gaps = [float(gaps_between(at, at, begins, ends).min()) for at in spots]
        found = []
        worst = int(np.argmax(gaps))
        margin = max(self._radius, *(leg.margin for leg in way.legs))
        if gaps[worst] > BESIDE + margin:
            where = ", ".join(f"{part:.1f}" for part in track[worst][0])
            found.append(f"{gaps[worst]:.1f} m beside its legs at {where}")
        for leg, end in zip(way.legs if not way.loops else (), ends, strict=False):
            missed = min(float(np.linalg.norm(at - end)) for at in spots)
            circles = items[min(leg.seq, len(items)) - 1].command in CIRCLES[self.kind] or leg.seq > len(items)
            if missed > AT + margin and not leg.is_last and not circles:  # of a circle it may fly a part
                found.append(
                    f"leg of item {leg.seq} to {', '.join(f'{p:.0f}' for p in end)}: missed by {missed:.1f} m"
                )
        fastest = max(speed for _, speed in track)
        allowed = max(leg.fastest.level for leg in way.legs)
        if fastest > allowed + FASTER:
            found.append(f"{fastest:.1f} m/s, predicted {allowed:.1f}")
        ends_there = not way.loops and self.kind != "plane"
        if ends_there and np.linalg.norm(spots[-1][0][:2] - ends[-1][:2]) > STAYS + margin:
            found.append(f"ends {float(np.linalg.norm(spots[-1][0][:2] - ends[-1][:2])):.1f} m beside")
        return found[:3]

    def _spot(self, stop: PathPoint) -> Any:
        return self._frame.spot(stop[:2], stop.up)


@contextlib.contextmanager
def vehicle(chosen: argparse.Namespace) -> Iterator[Station]:
    """A station of the vehicle: the embedded one in this process, or ArduPilot's in its own."""
    kind = chosen.vehicle
    if chosen.ardupilot is None:
        yield Station(OwnVehicle(kind, step=0.02))
        return
    home = chosen.ardupilot.resolve()
    defaults = home / "Tools" / "autotest" / DEFAULTS[kind]
    binary = home / "build" / "sitl" / "bin" / BINARIES[kind]
    command = [str(binary), f"--model={MODELS.get(kind, kind)}", f"-I{chosen.instance}", f"--defaults={defaults}"]
    command += [f"--home={','.join(map(str, HOME))}", f"--speedup={chosen.speedup}"]
    with tempfile.TemporaryDirectory(prefix="uavapi-missions-") as directory:
        quick = FilePath(directory) / "quick.parm"
        less = dict(LESS)
        if kind == "plane":  # whose own loops have 50 Hz; a copter's have 400
            less["SIM_RATE_HZ"] = 200
        quick.write_text("".join(f"{name} {value}\n" for name, value in less.items()))
        command[3] += f",{quick}"
        with running(command, 5760 + 10 * chosen.instance, directory) as station:
            station.run(30)  # until its GPS is healthy for good: else it disarms in its first mission
            yield station


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vehicle", choices=list(GUIDED), default="copter")
    parser.add_argument("--missions", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0, help="of the first; each further mission has the next")
    parser.add_argument("--ardupilot", type=FilePath, help="a copy of ArduPilot with SITL built")
    parser.add_argument("--odd", action="store_true", help="a copter's, with items that planners seldom write")
    parser.add_argument("--speedup", type=int, default=100)
    parser.add_argument("--instance", type=int, default=60)
    chosen = parser.parse_args()
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda *_: sys.exit(1))
    kind = chosen.vehicle
    tally: Counter[str] = Counter()
    with vehicle(chosen) as station:
        flights = Flights(station, kind)
        for seed in range(chosen.seed, chosen.seed + chosen.missions):
            dice = random.Random(seed)
            flights.other = Spot(dice.uniform(-60, 60), dice.uniform(-60, 60), dice.uniform(8, 20))
            items = Dice(seed).odd_mission() if chosen.odd else Dice(seed).mission(kind)
            try:
                found = flights.differences(items)
            except OutsideEnvelope as refused:
                tally["refused"] += 1
                print(f"seed {seed}: refused: {refused}", flush=True)
                continue
            tally["differs" if found else "as predicted"] += 1
            if kind != "plane":
                tally["inside" if flights.inside else "refused by FIELD"] += 1
                wrong = flights.outside > OUT if flights.inside else flights.outside <= 0
                tally["of these outside" if flights.inside else "of these inside"] += wrong
                if flights.inside and flights.outside > 0:
                    print(f"seed {seed}: accepted, and {flights.outside:.1f} m outside", flush=True)
            if kind == "copter":
                tally["apart" if flights.apart else "refused by the other copter"] += 1
                near = flights.nearest < SEPARATION
                tally["of these too near" if flights.apart else "of these not near"] += near is flights.apart
                if flights.apart and near:
                    print(f"seed {seed}: accepted, and {flights.nearest:.1f} m from the other copter", flush=True)
            names = " ".join(one.name for one in items)
            print(f"seed {seed}: {'; '.join(found) or 'as predicted'}: {names}", flush=True)
    print(f"{kind} on {'ArduPilot' if chosen.ardupilot else 'the embedded vehicle'}: {dict(tally)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
