"""A wire between MAVProxy and ArduPilot that records and misbehaves; its words are the embedded vehicle's.

The faults of the link (`silence`, `lose_acks`, `delay_acks`, `foreign_ack`, `refuse`, `in_progress`, `drop`, `nan`)
are the wire's own. What the pilot does (`pilot_mode`, `pilot_sticks`, `pilot_arm`, `pilot_disarm`), `other_station`
and `reboot` go to the vehicle as another ground station's messages, the sticks as MAVProxy's own RC overrides.
`ekf_bad` takes the simulated GPS away until `clear`. Until then `way` holds all back for so many s, either way, and
`hide` keeps the vehicle's messages of a name for so many s.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import threading
import time
from typing import Any

from pymavlink import mavutil

from mavproxy_uavapi.core.telemetry.flight_modes import mode_number
from mavproxy_uavapi.sim.faults import Faults

mavlink = mavutil.mavlink

PILOT, MAVPROXY, VEHICLE = (254, 190), (255, 230), (1, 1)
FORCE_REBOOT, FORCE_ARMING = 20190226, 21196
CLIMBING_THROTTLE = 1700  # microseconds
POSITION_ONLY, VELOCITY_ONLY = 0x0DF8, 0x0DC7
STICKS_PERIOD = 0.1  # s; ArduPilot forgets overrides after 3 s of its own, faster clock
RECONNECT = 0.2  # s between attempts to reach a vehicle that restarts


def encoder(source: tuple[int, int]) -> Any:
    """What makes bytes of messages in the name of that system and component."""
    return mavlink.MAVLink(None, *source)


def _setpoint(position: tuple[float, ...] = (0, 0, 0), velocity: tuple[float, ...] | None = None) -> Any:
    """A GUIDED setpoint in NED from the EKF origin."""
    mask = POSITION_ONLY if velocity is None else VELOCITY_ONLY
    fields = (*position, *(velocity or (0, 0, 0)), 0, 0, 0, 0, 0)
    frame = mavlink.MAV_FRAME_LOCAL_NED
    return mavlink.MAVLink_set_position_target_local_ned_message(0, *VEHICLE, frame, mask, *fields)


class Relay:
    """Listens for MAVProxy on `port`, and connects it to the vehicle's TCP port."""

    def __init__(self, vehicle_port: int) -> None:
        self._vehicle_port = vehicle_port
        self._faults = Faults()
        self._spoilt: set[str] = set()  # names of messages that carry NaN
        self._received: list[tuple[int, float, Any]] = []
        self._way = 0.0  # s
        self._hidden: dict[str, float] = {}  # until when (s), by the message's name
        self._sticks: list[int] | None = None
        self._encoders: dict[tuple[int, int], Any] = {}
        self._mavproxy: asyncio.StreamWriter | None = None
        self._vehicle: asyncio.StreamWriter | None = None
        self._lock = threading.Lock()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="relay")
        self._thread.start()
        self._server = self._run(asyncio.start_server(self._serve, "127.0.0.1", 0))
        self.port: int = self._server.sockets[0].getsockname()[1]
        self._holding = asyncio.run_coroutine_threadsafe(self._hold_sticks(), self._loop)

    def _run(self, coroutine: Any) -> Any:
        return asyncio.run_coroutine_threadsafe(coroutine, self._loop).result(30)

    # -- the back door ------------------------------------------------------------------------------------

    def ask(self, op: str, **arguments: Any) -> dict[str, Any]:
        """One operation: clear, or received."""
        with self._lock:
            if op == "clear":
                self._faults.clear()
                self._spoilt.clear()
                self._hidden.clear()
                self._way = 0.0
                self._enable_gps(True)
                return {"ok": True}
            assert op == "received", f"a wire knows nothing of {op}"
            newer = [entry for entry in self._received if entry[0] > arguments.get("since", 0)]
            reported = [(wall, message) for _, wall, message in newer if message.get_type() != "HEARTBEAT"]
            return {
                "ok": True,
                "last": newer[-1][0] if newer else arguments.get("since", 0),
                "messages": [
                    {"name": message.get_type(), "wall": wall, "fields": message.to_dict()}
                    for wall, message in reported
                ],
            }

    def fault(self, name: str, **arguments: Any) -> None:
        """Misbehave, or have the pilot do something."""
        with self._lock:
            if name == "silence":
                self._faults.silence(
                    time.monotonic(),
                    arguments.get("seconds", math.inf),
                    sending=arguments.get("sending", True),
                    receiving=arguments.get("receiving", True),
                )
            elif name == "pilot_mode":
                number = mode_number(mavlink.MAV_TYPE_QUADROTOR, arguments["mode"])
                self._sticks = [1500] * 4
                self._command(mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, number)
            elif name == "pilot_sticks":
                names = ("roll", "pitch", "throttle", "yaw")
                self._sticks = [arguments.get(stick, 1500) for stick in names]
                self._loop.call_soon_threadsafe(self._move_sticks)
            elif name == "pilot_arm":
                self._sticks = [1500, 1500, arguments.get("throttle", CLIMBING_THROTTLE), 1500]
                self._command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1, FORCE_ARMING)
            elif name == "other_station":
                self._loop.call_soon_threadsafe(self._order, _setpoint(**arguments), PILOT)
            elif name == "nan":
                seconds = arguments.get("seconds", math.inf)
                self._spoilt.add(arguments["message"])
                self._faults.spoil(arguments["message"], arguments.get("fields", ()), time.monotonic(), seconds)
            elif name == "pilot_disarm":
                self._command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, FORCE_ARMING)
            elif name == "way":
                self._way = arguments["seconds"]
            elif name == "hide":
                self._hidden[arguments["message"]] = time.monotonic() + arguments["seconds"]
            elif name == "ekf_bad":
                self._enable_gps(False)
            elif name == "reboot":
                self._sticks = None
                self._command(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1, 0, 0, 0, 0, FORCE_REBOOT)
            else:
                self._faults.add(name, arguments)

    def close(self) -> None:
        """Hang up on both."""
        self._holding.cancel()
        self._run(self._hang_up())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(10)
        self._loop.close()

    async def _hang_up(self) -> None:
        self._server.close()
        for writer in (self._mavproxy, self._vehicle):
            if writer is not None:
                writer.close()
        tasks = [task for task in asyncio.all_tasks() if task is not asyncio.current_task()]
        await asyncio.gather(*tasks, return_exceptions=True)

    # -- the wire -----------------------------------------------------------------------------------------

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._mavproxy = writer
        down = asyncio.ensure_future(self._down())
        try:
            await self._up(reader)
        finally:
            down.cancel()
            self._mavproxy = None
            writer.close()

    async def _up(self, reader: asyncio.StreamReader) -> None:
        """From MAVProxy to the vehicle."""
        parser = encoder((0, 0))
        parser.robust_parsing = True
        while data := await reader.read(65536):
            for message in parser.parse_buffer(data) or []:
                with self._lock:
                    self._pass_up(message)

    def _pass_up(self, message: Any) -> None:
        if self._vehicle is None or self._faults.deaf(time.monotonic()):
            return
        if self._faults.drops(message):
            return
        self._received.append((len(self._received) + 1, time.time(), message))
        if message.get_type() == "COMMAND_LONG":
            refused = self._faults.refusal(message.command)
            if refused is not None:
                self._say(mavlink.MAVLink_statustext_message(mavlink.MAV_SEVERITY_WARNING, refused.text.encode()))
                asker = (message.get_srcSystem(), message.get_srcComponent())
                self._say(mavlink.MAVLink_command_ack_message(message.command, refused.result, 0, 0, *asker))
                return
        self._later(self._vehicle, message)

    def _later(self, writer: asyncio.StreamWriter, message: Any) -> None:
        data = bytes(message.get_msgbuf())
        if self._way:
            self._loop.call_later(self._way, writer.write, data)
        else:
            writer.write(data)

    async def _down(self) -> None:
        """From the vehicle to MAVProxy, over as many connections as the vehicle's restarts need."""
        while True:
            try:
                reader, self._vehicle = await asyncio.open_connection("127.0.0.1", self._vehicle_port)
            except OSError:
                await asyncio.sleep(RECONNECT)
                continue
            parser = encoder((0, 0))
            parser.robust_parsing = True
            with contextlib.suppress(ConnectionError):
                while data := await reader.read(65536):
                    for message in parser.parse_buffer(data) or []:
                        with self._lock:
                            self._pass_down(message)
            self._vehicle.close()
            self._vehicle = None

    def _pass_down(self, message: Any) -> None:
        now = time.monotonic()
        is_hidden = self._hidden.get(message.get_type(), -math.inf) > now
        if self._mavproxy is None or self._faults.mute(now) or is_hidden:
            return
        if message.get_type() in self._spoilt:
            self._say(self._faults.spoilt(message, now), (message.get_srcSystem(), message.get_srcComponent()))
            return
        if message.get_type() != "COMMAND_ACK" or message.target_system != MAVPROXY[0]:
            self._later(self._mavproxy, message)
            return
        asker = (message.target_system, message.target_component)
        for planned in self._faults.acks(message.command, message.result, now):
            if planned.is_lost:
                continue
            ack = mavlink.MAVLink_command_ack_message(message.command, planned.result, 0, 0, *asker)
            self._loop.call_later(planned.at - now + self._way, self._say, ack, planned.source or VEHICLE)

    def _packed(self, message: Any, source: tuple[int, int]) -> bytes:
        return bytes(message.pack(self._encoders.setdefault(source, encoder(source))))

    def _say(self, message: Any, source: tuple[int, int] = VEHICLE) -> None:
        """To MAVProxy."""
        if self._mavproxy is not None:
            self._mavproxy.write(self._packed(message, source))

    def _command(self, number: int, *params: float) -> None:
        params = (*params, *(0.0,) * (7 - len(params)))
        order = mavlink.MAVLink_command_long_message(*VEHICLE, number, 0, *params)
        self._loop.call_soon_threadsafe(self._order, order, PILOT)

    def _enable_gps(self, enabled: bool) -> None:
        kind = mavlink.MAV_PARAM_TYPE_INT8
        parameter = mavlink.MAVLink_param_set_message(*VEHICLE, b"SIM_GPS1_ENABLE", enabled, kind)
        self._loop.call_soon_threadsafe(self._order, parameter, PILOT)

    def _order(self, message: Any, source: tuple[int, int]) -> None:
        if self._vehicle is not None:
            self._vehicle.write(self._packed(message, source))

    async def _hold_sticks(self) -> None:
        while True:
            self._move_sticks()
            await asyncio.sleep(STICKS_PERIOD)

    def _move_sticks(self) -> None:
        if self._sticks is not None:
            channels = [*self._sticks, *(0,) * 4]
            self._order(mavlink.MAVLink_rc_channels_override_message(*VEHICLE, *channels), MAVPROXY)
