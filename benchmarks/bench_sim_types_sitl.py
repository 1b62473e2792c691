"""The embedded plane, QuadPlane and rover beside ArduPilot's own: the same sequence, and where they differ.

    python benchmarks/bench_sim_types_sitl.py --ardupilot ~/ardupilot [--vehicle rover] [--speedup 10]

A ground station without MAVProxy talks to both. All seconds are the vehicle's. A line that begins with `*` differs:
texts, acknowledgements and modes at all, measured values by more than their tolerance.
"""

from __future__ import annotations

import argparse
import contextlib
import math
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

HOME = (-35.363261, 149.165230, 584.0, 353.0)
METRES_PER_DEGREE = 111318.845
BINARIES = {"rover": "ardurover", "plane": "arduplane", "quadplane": "arduplane"}
DEFAULTS = {
    "rover": "default_params/rover.parm",
    "plane": "models/plane.parm",
    "quadplane": "default_params/quadplane.parm",
}
WATCHED = ("LOCAL_POSITION_NED", "SYS_STATUS", "EXTENDED_SYS_STATE", "VFR_HUD", "MISSION_CURRENT")
PATIENCE = 600.0
"""Wall seconds that anything may take."""
NAN = math.nan
Results = dict[str, tuple[Any, float]]
"""By label the value, and the tolerance of a measured one."""


class Station:
    """A ground station of one vehicle; `at` is the vehicle's clock, s."""

    def __init__(self, port: int) -> None:
        self._link = mavutil.mavlink_connection(f"tcp:127.0.0.1:{port}", source_system=255, source_component=190)
        self.send = self._link.mav
        self.last: dict[str, Any] = {}
        self.texts: list[str] = []
        self.reached: list[int] = []
        self.at = 0.0
        self.wait(lambda: "HEARTBEAT" in self.last)
        for name in WATCHED:
            while self.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, _number(name), 100_000) != 0:
                pass
        self.wait(lambda: any("is using GPS" in text for text in self.texts) and self._healthy)
        self.run(3)

    @property
    def _healthy(self) -> bool:
        status = self.last.get("SYS_STATUS")
        return status is not None and bool(
            status.onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_PREARM_CHECK
        )

    def close(self) -> None:
        self._link.close()

    def hear(self) -> None:
        message = self._link.recv_match(blocking=True, timeout=0.5)
        if message is None or message.get_srcSystem() != 1:
            return
        name = message.get_type()
        self.last[name] = message
        if name == "LOCAL_POSITION_NED":
            self.at = message.time_boot_ms / 1000
        elif name == "STATUSTEXT":
            self.texts.append(message.text)
        elif name == "MISSION_ITEM_REACHED":
            self.reached.append(message.seq)

    def wait(self, condition: Callable[[], bool], most: float = math.inf) -> float:
        """Until it holds, or so many seconds of the vehicle have passed; the seconds that it took."""
        started, deadline = self.at, time.monotonic() + PATIENCE
        while not condition() and self.at - started < most:
            assert time.monotonic() < deadline, "the vehicle does not get there"
            self.hear()
        return round(self.at - started, 1)

    def run(self, seconds: float) -> None:
        self.wait(lambda: False, seconds)

    def _acknowledged(self, number: int) -> int | None:
        deadline = time.monotonic() + 5
        self.last.pop("COMMAND_ACK", None)
        while time.monotonic() < deadline:
            self.hear()
            ack = self.last.get("COMMAND_ACK")
            if ack is not None and ack.command == number:
                return int(ack.result)
        return None

    def command(self, number: int, *parameters: float) -> int | None:
        self.send.command_long_send(1, 1, number, 0, *parameters, *([0.0] * (7 - len(parameters))))
        return self._acknowledged(number)

    def reposition(
        self, north: float, east: float, z: float = 0.0, change: int = 1, radius: float = 0.0
    ) -> int | None:
        lat, lon = place(north, east)
        number = mavlink.MAV_CMD_DO_REPOSITION
        self.send.command_int_send(
            1, 1, 3, number, 0, 0, -1, change, radius, NAN, round(lat * 1e7), round(lon * 1e7), z
        )
        return self._acknowledged(number)

    def mode(self, number: int) -> int | None:
        return self.command(mavlink.MAV_CMD_DO_SET_MODE, 1, number)

    def arm(self) -> int | None:
        return self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)

    def disarm(self) -> int | None:
        return self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0)

    def parameter(self, name: str, value: float) -> None:
        self.last.pop("PARAM_VALUE", None)
        self.send.param_set_send(1, 1, name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32)
        self.wait(lambda: "PARAM_VALUE" in self.last)

    def drive_to(self, north: float, east: float) -> None:
        self.send.set_position_target_local_ned_send(0, 1, 1, 1, 0x0DF8, north, east, 0, 0, 0, 0, 0, 0, 0, 0, 0)

    def upload(self, items: list[tuple[int, tuple[float, ...], tuple[float, float] | None, float]]) -> int:
        self.send.mission_count_send(1, 1, len(items), 0)
        deadline = time.monotonic() + 60
        self.last.pop("MISSION_ACK", None)
        while "MISSION_ACK" not in self.last:
            assert time.monotonic() < deadline, "the vehicle takes no mission"
            self.last.pop("MISSION_REQUEST", None)
            self.hear()
            request = self.last.get("MISSION_REQUEST")
            if request is None:
                continue
            command, parameters, where, z = items[request.seq]
            lat, lon = place(*where) if where is not None else (0.0, 0.0)
            four = (*parameters, *([0.0] * (4 - len(parameters))))
            spot = (round(lat * 1e7), round(lon * 1e7), z)
            self.send.mission_item_int_send(1, 1, request.seq, 3, command, 0, 1, *four, *spot, 0)
        return int(self.last["MISSION_ACK"].type)

    # What the vehicle shows.

    @property
    def position(self) -> tuple[float, float]:
        return self.last["LOCAL_POSITION_NED"].x, self.last["LOCAL_POSITION_NED"].y

    @property
    def height(self) -> float:
        return -float(self.last["LOCAL_POSITION_NED"].z)

    @property
    def speed(self) -> float:
        return math.hypot(self.last["LOCAL_POSITION_NED"].vx, self.last["LOCAL_POSITION_NED"].vy)

    @property
    def armed(self) -> bool:
        return bool(self.last["HEARTBEAT"].base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)

    @property
    def heartbeat(self) -> tuple[int, int, int, int]:
        """Type, base mode, mode, status."""
        self.last.pop("HEARTBEAT", None)
        self.wait(lambda: "HEARTBEAT" in self.last)
        output = self.last["HEARTBEAT"]
        return output.type, output.base_mode, output.custom_mode, output.system_status

    @property
    def landed_state(self) -> tuple[int, int]:
        output = self.last["EXTENDED_SYS_STATE"]
        return output.vtol_state, output.landed_state

    def away(self, north: float, east: float) -> float:
        return math.dist(self.position, (north, east))

    def circle(self, north: float, east: float, seconds: float = 40.0) -> tuple[float, float]:
        """Mean radius around a place, and mean speed."""
        radii, speeds, end = [], [], self.at + seconds
        while self.at < end:
            self.hear()
            radii.append(self.away(north, east))
            speeds.append(self.speed)
        return round(sum(radii) / len(radii), 1), round(sum(speeds) / len(speeds), 1)

    def streams(self) -> list[str]:
        """What comes with all streams at 4 Hz."""
        self.send.request_data_stream_send(1, 1, mavlink.MAV_DATA_STREAM_ALL, 4, 1)
        self.run(1)
        self.last = {"LOCAL_POSITION_NED": self.last["LOCAL_POSITION_NED"]}
        self.run(2)
        return sorted(self.last)


def place(north: float, east: float) -> tuple[float, float]:
    """Degrees of a place so many metres from home."""
    lat, lon = HOME[:2]
    return lat + north / METRES_PER_DEGREE, lon + east / (METRES_PER_DEGREE * math.cos(math.radians(lat)))


def _number(name: str) -> int:
    return int(getattr(mavlink, f"MAVLINK_MSG_ID_{name}"))


def acknowledgements(station: Station, numbers: tuple[int, ...]) -> dict[int, int | None]:
    return {number: station.command(number) for number in numbers}


def modes(station: Station, numbers: tuple[int, ...]) -> dict[int, tuple[Any, ...]]:
    """By mode: the acknowledgement, base mode and mode after it, that of arming."""
    answers = {}
    for number in numbers:
        result = station.mode(number)
        station.run(0.3)
        beat = station.heartbeat
        answers[number] = (result, beat[1], beat[2], station.arm())
        station.disarm()
    return answers


def rover(station: Station) -> Results:
    results: Results = {"heartbeat": (station.heartbeat, 0), "landed state": (station.landed_state, 0)}
    results["streams"] = (station.streams(), 0)
    results["modes"] = (modes(station, (0, 1, 3, 4, 5, 6, 8, 10, 11, 12, 15, 16, 2)), 0)
    numbers = (22, 21, 115, 193, 178, 194, 213, 17, 195, 185, 189, 84, 300, 401)
    results["commands"] = (acknowledgements(station, numbers), 0)
    station.mode(15)
    station.arm()
    station.drive_to(60, 0)
    station.reached.clear()
    results["60 m in GUIDED, s"] = (station.wait(lambda: bool(station.reached), 60), 2)
    station.drive_to(60, 30)
    station.run(9)
    results["a right angle: aside of the line after 9 s, m"] = (round(abs(station.position[0] - 60), 1), 2)
    for name, number in (("HOLD", 4), ("LOITER", 5)):
        station.mode(15)
        station.drive_to(-200, 30)
        station.run(14)
        start = station.position
        station.mode(number)
        station.wait(lambda: station.speed < 0.1, 30)
        results[f"{name} from 5 m/s, m"] = (round(station.away(*start), 1), 1.5)
    station.mode(15)
    station.drive_to(0, 0)
    station.run(8)
    results["disarm on the way"] = (station.disarm(), 0)
    start = station.position
    station.wait(lambda: station.speed < 0.1, 30)
    results["it rolls, m"] = (round(station.away(*start), 1), 1.5)
    station.arm()
    station.run(5)
    results["armed again it goes on"] = (station.speed > 2, 0)
    station.mode(11)
    results["RTL brings it within, m"] = (_come_home(station), 1)
    station.reached.clear()
    station.upload(
        [
            (16, (), (0, 0), 0),
            (16, (), (30, 0), 0),
            (178, (1, 2), None, 0),
            (16, (), (30, 30), 0),
            (194, (1,), None, 0),
            (16, (3,), (0, 30), 0),
            (194, (0,), None, 0),
            (93, (2, -1, -1, -1), None, 0),
            (19, (2,), (0, 0), 0),
            (20, (), None, 0),
        ]
    )
    station.command(mavlink.MAV_CMD_MISSION_START)
    results["mission, s"] = (station.wait(lambda: "Mission Complete" in station.texts, 200), 8)
    station.run(1)
    results["mission, items told"] = (list(station.reached), 0)
    return results


def _come_home(station: Station) -> float:
    station.wait(lambda: "Reached destination" in station.texts, 120)
    station.run(2)
    return round(station.away(0, 0), 1)


def plane(station: Station) -> Results:
    results: Results = {"heartbeat": (station.heartbeat, 0), "landed state": (station.landed_state, 0)}
    results["streams"] = (station.streams(), 0)
    results["modes"] = (modes(station, (0, 1, 2, 5, 6, 7, 9, 10, 11, 12, 13, 14, 15, 16, 17, 20)), 0)
    station.mode(0)
    numbers = (22, 21, 115, 193, 178, 194, 195, 185, 189, 191, 17, 20, 300, 401)
    results["commands"] = (acknowledgements(station, numbers), 0)
    station.mode(13)
    station.arm()
    results["take-off to 48 m, s"] = (station.wait(lambda: station.height > 48, 40), 1.5)
    results["landed state then"] = (station.landed_state, 0)
    station.run(40)
    results["disarm in flight"] = (station.disarm(), 0)
    results["reposition"] = (station.reposition(500, 0, 100), 0)
    results["climb from 50 m to 98 m, s"] = (station.wait(lambda: station.height > 98, 60), 4)
    station.run(20)
    radius, speed = station.circle(500, 0)
    results["circle of WP_LOITER_RAD 80, m"] = (radius, 4)
    results["speed over ground at 22 m/s, m/s"] = (speed, 0.5)
    station.reposition(500, 0, 100, radius=120)
    station.run(40)
    results["circle of radius 120, m"] = (station.circle(500, 0)[0], 5)
    station.command(mavlink.MAV_CMD_DO_CHANGE_SPEED, 0, 26, -1)
    station.run(15)
    results["airspeed of 26, m/s"] = (round(station.last["VFR_HUD"].airspeed, 1), 0.7)
    station.command(mavlink.MAV_CMD_DO_CHANGE_SPEED, 0, -2, -1)
    results["RTL"] = (station.mode(11), 0)
    results["home within 150 m, s"] = (station.wait(lambda: station.away(0, 0) < 150, 90), 5)
    station.parameter("RTL_AUTOLAND", 2)
    station.reached.clear()
    station.texts.clear()
    station.upload(
        [
            (16, (), (0, 0), 0),
            (16, (), (400, 0), 100),
            (178, (0, 26, -1), None, 0),
            (16, (), (400, 400), 120),
            (18, (1, 0, 60), (0, 400), 100),
            (19, (20,), (-200, 400), 100),
            (31, (1, 80), (-400, 0), 60),
            (189, (), None, 0),
            (16, (), (-700, 0), 40),
            (16, (), (-400, 0), 20),
            (21, (), (0, 0), 0),
        ]
    )
    station.command(mavlink.MAV_CMD_MISSION_START)
    results["mission with a landing, s"] = (station.wait(lambda: not station.armed, 500), 12)
    station.run(1)
    results["mission, items told"] = (list(station.reached), 0)
    results["it stops from the landing point, m"] = (round(station.away(0, 0), 1), 20)
    results["arming after it"] = (station.arm(), 0)
    return results


def quadplane(station: Station) -> Results:
    results: Results = {"heartbeat": (station.heartbeat, 0), "landed state": (station.landed_state, 0)}
    results["modes"] = (modes(station, (0, 15, 17, 18, 19, 20, 21)), 0)
    station.mode(15)
    results["take-off disarmed"] = (station.command(22, 0, 0, 0, 0, 0, 0, 20), 0)
    station.arm()
    station.run(4)
    results["take-off"] = (station.command(22, 0, 0, 0, 0, 0, 0, 20), 0)
    results["20 m, s"] = (station.wait(lambda: station.height > 19.5, 40), 1.5)
    station.run(3)
    results["landed state there"] = (station.landed_state, 0)
    results["take-off again"] = (station.command(22, 0, 0, 0, 0, 0, 0, 30), 0)
    station.reposition(300, 0, 50)
    results["transition, s"] = (station.wait(lambda: "Transition done" in station.texts, 40), 2)
    station.run(30)
    results["circle of WP_LOITER_RAD 60, m"] = (station.circle(300, 0)[0], 4)
    results["QRTL"] = (station.mode(21), 0)
    results["QRTL to disarming, s"] = (station.wait(lambda: not station.armed, 200), 12)
    results["it lands from home, m"] = (round(station.away(0, 0), 1), 1)
    station.mode(15)
    station.arm()
    station.run(4)
    station.command(22, 0, 0, 0, 0, 0, 0, 20)
    station.run(15)
    station.mode(20)
    results["QLAND from 20 m, s"] = (station.wait(lambda: not station.armed, 120), 4)
    station.texts.clear()
    station.reached.clear()
    station.upload(
        [
            (16, (), (0, 0), 0),
            (84, (), None, 30),
            (16, (), (300, 0), 50),
            (16, (), (300, 300), 50),
            (85, (), (0, 0), 0),
        ]
    )
    station.mode(10)
    station.arm()
    results["mission with take-off and landing, s"] = (
        station.wait(lambda: "Land complete" in station.texts, 300),
        15,
    )
    station.run(1)
    results["mission, items told"] = (list(station.reached), 0)
    return results


SEQUENCES: dict[str, Callable[[Station], Results]] = {"rover": rover, "plane": plane, "quadplane": quadplane}


@contextlib.contextmanager
def running(command: list[str], port: int, directory: str) -> Iterator[Station]:
    """The process and a station of it; the process is killed at the end, whatever it does."""
    with subprocess.Popen(command, cwd=directory, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            deadline = time.monotonic() + PATIENCE
            while True:
                with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=1):
                    break
                assert time.monotonic() < deadline, f"nothing listens on {port}"
                time.sleep(0.5)
            station = Station(port)
            try:
                yield station
            finally:
                station.close()
        finally:
            process.kill()


def fly(kind: str, command: list[str], port: int) -> Results:
    with (
        tempfile.TemporaryDirectory(prefix="uavapi-types-") as directory,
        running(command, port, directory) as station,
    ):
        return SEQUENCES[kind](station)


def differs(sitl: Any, embedded: Any, tolerance: float) -> bool:
    if tolerance and isinstance(sitl, (int, float)) and isinstance(embedded, (int, float)):
        return abs(sitl - embedded) > tolerance
    return bool(sitl != embedded)


def shown(value: Any, other: Any) -> str:
    """The value, of a table or list only what the other has not."""
    if isinstance(value, dict) and isinstance(other, dict):
        return str({key: part for key, part in value.items() if other.get(key) != part} or "same")
    if isinstance(value, list) and value and isinstance(value[0], str):
        return str([part for part in value if part not in other] or "same")
    return str(value)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ardupilot", type=Path, required=True, help="a copy of ArduPilot with SITL built")
    parser.add_argument("--vehicle", choices=list(SEQUENCES), action="append", help="all without it")
    parser.add_argument("--speedup", type=int, default=10)
    parser.add_argument("--instance", type=int, default=50, help="of SITL; the embedded one has the next")
    chosen = parser.parse_args()
    home = ",".join(map(str, HOME))
    for kind in chosen.vehicle or SEQUENCES:
        tools = chosen.ardupilot.resolve() / "Tools" / "autotest"
        binary = chosen.ardupilot.resolve() / "build" / "sitl" / "bin" / BINARIES[kind]
        options = [f"--home={home}", f"--speedup={chosen.speedup}"]
        sitl = [
            str(binary),
            f"--model={kind}",
            f"-I{chosen.instance}",
            f"--defaults={tools / DEFAULTS[kind]}",
            *options,
        ]
        module = [sys.executable, "-m", "mavproxy_uavapi.sim", f"--vehicle={kind}"]
        embedded = [*module, f"--instance={chosen.instance + 1}", *options]
        theirs = fly(kind, sitl, 5760 + 10 * chosen.instance)
        ours = fly(kind, embedded, 5760 + 10 * (chosen.instance + 1))
        print(f"{kind}: ArduPilot's SITL | embedded")
        for label, (value, tolerance) in theirs.items():
            other = ours[label][0]
            mark = "*" if differs(value, other, tolerance) else " "
            print(f"{mark} {label}: {shown(value, other)} | {shown(other, value)}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
