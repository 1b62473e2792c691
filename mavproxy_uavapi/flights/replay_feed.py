"""Plays a record as the vehicles' MAVLink on a TCP port, for any ground station. What it is sent, it ignores.

    python -m mavproxy_uavapi.flights.replay_feed flight.mcap --port 5760 --speedup 10

At the end it falls silent, so that whatever looks at it says that the link is lost.
"""

from __future__ import annotations

import argparse
import asyncio
import math
import struct
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from mcap.exceptions import McapError
from mcap.reader import make_reader
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.errors import BadRequest, Invalid
from mavproxy_uavapi.core.geodesy import to_deg_e7
from mavproxy_uavapi.core.telemetry.flight_modes import mode_number
from mavproxy_uavapi.core.terminal import say
from mavproxy_uavapi.flights.flight_file import STREAMED, RecordedMessage, messages_of

TYPES = {
    "copter": mavlink.MAV_TYPE_QUADROTOR,
    "plane": mavlink.MAV_TYPE_FIXED_WING,
    "rover": mavlink.MAV_TYPE_GROUND_ROVER,
}
REMIND = 30.0  # s of the record from one text that says what it is to the next
UNKNOWN_U16, UNKNOWN_U8 = 65535, 255
Info = Mapping[str, Any]


def vehicles_in(path: Path) -> list[int]:
    """The system ids of a complete record.

    Raises:
        BadRequest: it is none.
        OSError: it cannot be read.
    """
    with path.open("rb") as file:
        try:
            for metadata in make_reader(file).iter_metadata():
                if metadata.name == "flight" and metadata.metadata.get("vehicles"):
                    return [int(system) for system in metadata.metadata["vehicles"].split(",")]
        except (McapError, OSError, struct.error, ValueError) as error:  # it is shorter than what it should end with
            raise BadRequest(f"{path.name} is not the file of a flight, or damaged") from error
    raise BadRequest(f"{path.name} is not the file of a flight")


def _heartbeat(info: Info, _boot_ms: int) -> Any:
    vehicle_type = TYPES.get(info["vehicle_type"], mavlink.MAV_TYPE_GENERIC)
    armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if info["armed"] else 0
    try:
        mode = mode_number(vehicle_type, info["mode"] or "")
    except Invalid:
        mode = 0
    flags = armed | mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    state = mavlink.MAV_STATE_ACTIVE if armed else mavlink.MAV_STATE_STANDBY
    return mavlink.MAVLink_heartbeat_message(vehicle_type, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, flags, mode, state, 3)


def _place(info: Info, boot_ms: int) -> Any:
    place, speed = info["position"], info["velocity"]
    heading = UNKNOWN_U16 if info["heading"] is None else round(info["heading"] * 100) % 36000
    return mavlink.MAVLink_global_position_int_message(
        boot_ms,
        to_deg_e7(place["lat"]),
        to_deg_e7(place["lon"]),
        round((place["alt"] or 0.0) * 1000),
        round((place["relative_alt"] or 0.0) * 1000),
        *(round((speed.get(name) or 0.0) * 100) for name in ("vx", "vy", "vz")),
        heading,
    )


def _local(info: Info, boot_ms: int) -> Any:
    place, speed = info["position"], info["velocity"]
    values = [place["x"], place["y"], place["z"], speed["vx"], speed["vy"], speed["vz"]]
    return mavlink.MAVLink_local_position_ned_message(boot_ms, *(math.nan if one is None else one for one in values))


def _attitude(info: Info, boot_ms: int) -> Any:
    names = ("roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed")
    return mavlink.MAVLink_attitude_message(boot_ms, *(math.radians(info.get(name) or 0.0) for name in names))


def _speeds(info: Info, _boot_ms: int) -> Any:
    return mavlink.MAVLink_vfr_hud_message(
        info["airspeed"] or 0.0,
        info["groundspeed"] or 0.0,
        round(info["heading"] or 0),
        round(info["throttle"] or 0),
        info["alt"] or 0.0,
        0.0,
    )


def _receiver(info: Info, boot_ms: int) -> Any:
    place, course = info["position"], info["velocity"]

    def hundredths(value: float | None) -> int:
        return UNKNOWN_U16 if value is None else round(value * 100)

    return mavlink.MAVLink_gps_raw_int_message(
        boot_ms * 1000,
        info["fix_type"],
        to_deg_e7(place["lat"]),
        to_deg_e7(place["lon"]),
        round((place["alt"] or 0.0) * 1000),
        UNKNOWN_U16,
        UNKNOWN_U16,
        hundredths(course["ground_speed"]),
        hundredths(course["speed_direction"]),
        UNKNOWN_U8 if info["satelites"] is None else info["satelites"],
    )


def _battery(info: Info, _boot_ms: int) -> Any:
    voltage = UNKNOWN_U16 if info["voltage"] is None else info["voltage"]
    current, left = (-1 if info.get(name) is None else info[name] for name in ("current", "battery_remaining"))
    return mavlink.MAVLink_sys_status_message(0, 0, 0, 0, voltage, current, left, 0, 0, 0, 0, 0, 0)


def _home(info: Info, _boot_ms: int) -> Any:
    local = (info[name] or 0.0 for name in ("x", "y", "z"))
    place = to_deg_e7(info["lat"]), to_deg_e7(info["lon"]), round(info["altitude"] * 1000)
    return mavlink.MAVLink_home_position_message(*place, *local, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0)


def _text(info: Info, _boot_ms: int) -> Any:
    return mavlink.MAVLink_statustext_message(info["severity"], str(info["text"]).encode()[:50])


MESSAGES: Mapping[str, Callable[[Info, int], Any]] = {
    "status": _heartbeat,
    "gps": _place,
    "ned": _local,
    "attitude": _attitude,
    "general": _speeds,
    "gps_raw": _receiver,
    "battery": _battery,
    "home": _home,
    "statustext": _text,
}
"""View or event of the stream to the MAVLink message that it was made of."""


class Feed:
    """The frames of a record. Pure.

    Args:
        path: of the record.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._encoders: dict[int, Any] = {}

    def frames(self) -> Iterator[tuple[float, bytes]]:
        """Each frame with its time: s since the first one."""
        began = remind_at = -math.inf
        for message in messages_of(self._path):
            make = MESSAGES.get(message.topic.rpartition("/")[2])
            if make is None or message.schema not in STREAMED:
                continue
            system = message.data["system"]
            if began == -math.inf:
                began = message.time
            seconds = max(message.time - began, 0.0)
            if seconds >= remind_at + REMIND:
                remind_at = seconds
                yield seconds, self._packed(system, _text({"severity": 5, "text": "REPLAY: nothing here is live"}, 0))
            with suppress(struct.error):  # of a log that was imported: more than MAVLink's integers hold
                yield seconds, self._packed(system, make(message.data["info"], self._boot_ms(message, began)))

    def _boot_ms(self, message: RecordedMessage, began: float) -> int:
        return max(0, round((message.time - began) * 1000)) % 2**32

    def _packed(self, system: int, message: Any) -> bytes:
        encoder = self._encoders.get(system)
        if encoder is None:
            encoder = self._encoders[system] = mavlink.MAVLink(None, system, mavlink.MAV_COMP_ID_AUTOPILOT1)
        packed: bytes = message.pack(encoder)
        encoder.seq = (encoder.seq + 1) % 256
        return packed


async def serve(path: Path, port: int, speedup: float) -> None:
    """Play to whoever connects, from the first connection on; until it is cancelled.

    Raises:
        BadRequest: it is no record.
        OSError: the port is taken, or the record cannot be read.
    """
    writers: set[asyncio.StreamWriter] = set()
    somebody = asyncio.Event()

    async def joined(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writers.add(writer)
        somebody.set()
        with suppress(ConnectionError):
            while await reader.read(4096):
                pass  # it is a record: nothing can be commanded
        writers.discard(writer)
        writer.close()

    async with await asyncio.start_server(joined, "127.0.0.1", port) as server:
        systems = ", ".join(map(str, vehicles_in(path)))
        say(f"replay: vehicle {systems} of {path.name} listening on tcp:127.0.0.1:{port}")
        await somebody.wait()
        loop = asyncio.get_running_loop()
        began = loop.time()
        for seconds, frame in Feed(path).frames():
            ahead = began + seconds / speedup - loop.time()
            if ahead > 0.002:
                await asyncio.sleep(ahead)
            for writer in writers:
                writer.write(frame)
        await server.serve_forever()


def main(arguments: list[str] | None = None) -> int:
    """Run it until a signal; the exit status is 1 if the record or the port fails."""
    parser = argparse.ArgumentParser(prog="mavproxy_uavapi.flights.replay_feed", description="a record as MAVLink")
    parser.add_argument("file", type=Path, help="a flight's .mcap")
    parser.add_argument("--port", type=int, default=5760, help="TCP port (%(default)d)")
    parser.add_argument("--speedup", type=float, default=1.0, help="times as fast (%(default)g)")
    chosen = parser.parse_args(arguments)
    try:
        asyncio.run(serve(chosen.file, chosen.port, chosen.speedup))
    except (OSError, BadRequest) as error:
        say(f"replay: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 0
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
