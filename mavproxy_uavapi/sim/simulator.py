"""The vehicle with its MAVLink links: messages in, simulated time on, messages out. No sockets, no clock.

Typical use, in a test::

    simulator = Simulator(Options(seed=1))
    link = simulator.open_link()
    simulator.receive(link, message)
    simulator.step()
    for message in link.messages(): ...

The same options and the same inputs at the same simulated times give the same states and messages.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from .commands import UNSUPPORTED, from_message
from .copter.copter import SimulatedCopter
from .dataflash import Dataflash
from .decks import Decks
from .faults import Faults, PlannedAck
from .kinds import KINDS
from .link import COMPONENT, PeerLink
from .log_protocol import LogProtocol
from .mission import Item, Mission
from .mission_protocol import MissionProtocol
from .options import Options
from .parameters import Parameter, ParameterStore
from .telemetry import TelemetryMessages
from .transmitter import Transmitter

PARAMETERS_PER_STEP = 20
UNKNOWN_INDEX = 65535
REMEMBERED_MESSAGES = 20000
FTP_NAK = 129
FTP_UNKNOWN_COMMAND = 7
FTP_HEADER = 12


@dataclass(frozen=True)
class ReceivedMessage:
    """A message that came from a ground link: simulated seconds since boot, wall time as given."""

    index: int
    time: float
    wall: float
    link: str
    message: Any


class Simulator:
    """One vehicle and its links; epoch is the unix time in seconds at which it boots."""

    def __init__(self, options: Options, epoch: float = 0.0) -> None:
        self.options = options
        self._kind = KINDS[options.vehicle]
        self.parameters = ParameterStore(self._kind.parameters, options.firmware)
        self.parameters.set("SIM_SPEEDUP", options.speedup)
        self.parameters.put("MAV_SYSID", options.sysid)
        self.parameters.set("SIM_WIND_SPD", options.wind.speed)
        self.parameters.set("SIM_WIND_DIR", options.wind.direction)
        for name, value in options.defaults:
            self.parameters.adopt(name, value)
        if options.battery > 0:
            self.parameters.set("BATT_CAPACITY", options.battery)
            self.parameters.set("SIM_BATT_CAP_AH", options.battery / 1000)
        self.faults = Faults()
        self.links: list[PeerLink] = []
        self.received: deque[ReceivedMessage] = deque(maxlen=REMEMBERED_MESSAGES)
        self._received_count = 0
        self._boots = 0
        self._epoch = epoch
        self._reboot_wanted = False
        self._handlers = {
            "HEARTBEAT": self._heartbeat,
            "COMMAND_LONG": self._command,
            "COMMAND_INT": self._command,
            "SET_MODE": self._set_mode,
            "REQUEST_DATA_STREAM": self._request_stream,
            "PARAM_REQUEST_LIST": self._parameter_list,
            "PARAM_REQUEST_READ": self._parameter_read,
            "PARAM_SET": self._parameter_set,
            "MISSION_SET_CURRENT": self._mission_set_current,
            "RC_CHANNELS_OVERRIDE": self._sticks,
            "TIMESYNC": self._timesync,
            "FILE_TRANSFER_PROTOCOL": self._file_transfer,
        }
        self._lists: dict[int, list[Item]] = {}  # the fence and rally points
        self.dataflash = Dataflash()
        self._boot(Mission())

    def _boot(self, mission: Mission) -> None:
        """Boot: time zero, disarmed, where the vehicle began. Parameters, mission and logs stay."""
        self._boots += 1
        seed = self.options.seed + self._boots - 1
        self.vehicle = self._kind.vehicle(self.options, self.parameters, mission, seed)
        self.decks = Decks(self.vehicle.estimator.start)
        self.telemetry = TelemetryMessages(self.vehicle, self._epoch)
        self.missions = MissionProtocol(self.vehicle, self._lists)
        self.dataflash.close()
        self._logs = LogProtocol(self.vehicle, self.dataflash)
        self._transmitter = Transmitter(self.vehicle, self.telemetry, self.faults, self.links)
        self.commands = self._kind.commands(self.vehicle, self.telemetry, self._transmitter, self.reboot_soon)
        self._reboot_wanted = False
        for link in self.links:
            link.restart()

    def reboot_soon(self) -> None:
        """Boot again after the present step, so that an acknowledgement still goes out."""
        self._reboot_wanted = True

    @property
    def copter(self) -> SimulatedCopter:
        """The vehicle of a simulation of a copter."""
        assert isinstance(self.vehicle, SimulatedCopter)
        return self.vehicle

    @property
    def speedup(self) -> float:
        """Simulated seconds that should pass in a wall second (SIM_SPEEDUP); always positive."""
        speedup = self.parameters["SIM_SPEEDUP"]
        return speedup if speedup > 0 else 1.0

    # Links.

    def open_link(self, name: str = "") -> PeerLink:
        """A new link; it gets heartbeats at once and streams when it asks for them."""
        link = PeerLink(
            self.options.sysid, name, lambda: self.faults.mute(self.vehicle.now), self._kind.vehicle.streams
        )
        self.links.append(link)
        return link

    def close_link(self, link: PeerLink) -> None:
        """The peer has gone."""
        self.links.remove(link)

    # Time.

    def step(self) -> None:
        """Advance by one step and queue what the links get in that time."""
        vehicle = self.vehicle
        self.telemetry.freeze_position(vehicle.now < self.faults.gps_frozen_until)
        vehicle.step(self.options.step)
        self.decks.carry(vehicle.body, vehicle.now)
        self.missions.step()
        self.dataflash.step(vehicle, self._epoch)
        self._logs.step()
        while vehicle.events:
            self._transmitter.emit(vehicle.events.popleft())
        self._transmitter.send_planned()
        for link in self.links:
            for name in link.streams.due(vehicle.now):
                self._transmitter.send(link, name)
            if link.parameter_cursor is not None:
                self._send_parameters(link)
        if self._reboot_wanted:
            self._epoch += vehicle.now
            self._boot(vehicle.mission)

    def run(self, seconds: float) -> None:
        """Advance by about seconds of simulated time."""
        for _ in range(round(seconds / self.options.step)):
            self.step()

    # What comes in.

    def receive(self, link: PeerLink, message: Any, wall: float = 0.0) -> None:
        """Take a decoded message from a link; wall is the caller's clock, kept for `received` only."""
        vehicle = self.vehicle
        if self.faults.deaf(vehicle.now) or not self._for_us(message) or self.faults.drops(message):
            return
        self._received_count += 1
        self.received.append(ReceivedMessage(self._received_count, vehicle.now, wall, link.name, message))
        if self.missions.handle(link, message) or self._logs.handle(link, message):
            return
        handler = self._handlers.get(message.get_type())
        own = self._kind.messages.get(message.get_type())
        if handler is not None:
            handler(link, message)
        elif own is not None:
            own(vehicle, message)

    def _for_us(self, message: Any) -> bool:
        system = getattr(message, "target_system", 0)
        component = getattr(message, "target_component", 0)
        return system in (0, self.options.sysid) and component in (0, COMPONENT)

    def _command(self, link: PeerLink, message: Any) -> None:
        fault = self.faults.refusal(message.command)
        if fault is not None:
            result = fault.result
            if fault.text:
                self.vehicle.say(mavlink.MAV_SEVERITY_WARNING, fault.text)
        else:
            command = from_message(message, link)
            result = UNSUPPORTED if command is None else self.commands.run(command)
        # As in SITL the acknowledgement goes out at once; texts that explain it and the heartbeat of a new mode
        # wait for the next step, so they come after it.
        sender = (message.get_srcSystem(), message.get_srcComponent())
        for ack in self.faults.acks(message.command, result, self.vehicle.now):
            self._plan_ack(link, message.command, ack, sender)

    def _plan_ack(self, link: PeerLink, command: int, planned: PlannedAck, sender: tuple[int, int]) -> None:
        ack = mavlink.MAVLink_command_ack_message(command, planned.result, 0, 0, *sender)
        if planned.is_lost:
            link.lose()
        elif planned.at <= self.vehicle.now:
            link.send(ack, planned.source)
        else:
            self._transmitter.plan(planned.at, link, ack, planned.source)

    def _set_mode(self, link: PeerLink, message: Any) -> None:
        self.commands.set_mode(message.base_mode, message.custom_mode)

    def _heartbeat(self, link: PeerLink, message: Any) -> None:
        if message.get_srcSystem() == self.parameters["MAV_GCS_SYSID"]:
            self.vehicle.station_heard_at = self.vehicle.now

    def _request_stream(self, link: PeerLink, message: Any) -> None:
        rate = message.req_message_rate if message.start_stop == 1 else 0
        for group in link.streams.request_group(message.req_stream_id, rate, self.vehicle.now):
            # As in ArduPilot it is the stream's default from now on.
            self.parameters.put(self.vehicle.rate_parameter(group), rate)

    def _parameter_list(self, link: PeerLink, message: Any) -> None:
        link.parameter_cursor = 0

    def _send_parameters(self, link: PeerLink) -> None:
        start = link.parameter_cursor or 0
        for parameter in self.parameters.ordered[start : start + PARAMETERS_PER_STEP]:
            link.send(self._parameter_value(parameter, parameter.index))
        following = start + PARAMETERS_PER_STEP
        link.parameter_cursor = following if following < len(self.parameters) else None

    def _parameter_value(self, parameter: Parameter, index: int) -> Any:
        name = parameter.name.encode()
        return mavlink.MAVLink_param_value_message(name, parameter.value, parameter.kind, len(self.parameters), index)

    def _parameter_read(self, link: PeerLink, message: Any) -> None:
        parameter = self.parameters.find(message.param_id, message.param_index)
        if parameter is not None:
            index = message.param_index if message.param_index >= 0 else UNKNOWN_INDEX
            link.send(self._parameter_value(parameter, index))

    def _parameter_set(self, link: PeerLink, message: Any) -> None:
        """An unknown name is not answered; a new value is sent to all links."""
        value = message.param_value
        if not math.isfinite(value):
            return
        parameter = self.parameters.set(message.param_id, value)
        if parameter is not None:
            for one in self.links:
                one.send(self._parameter_value(parameter, UNKNOWN_INDEX))

    def _mission_set_current(self, link: PeerLink, message: Any) -> None:
        """Unlike the command it ends a landing sequence, as in ArduPilot, even if there is no such item."""
        self.vehicle.mission.in_landing_sequence = False
        if self.vehicle.current_item(message.seq):
            link.send(self.telemetry.mission_current(message.seq))

    def _sticks(self, link: PeerLink, message: Any) -> None:
        pulses = [getattr(message, f"chan{channel}_raw") for channel in range(1, 9)]
        self.vehicle.sticks.override(pulses, self.vehicle.now)

    def _timesync(self, link: PeerLink, message: Any) -> None:
        if message.tc1 == 0:
            link.send(mavlink.MAVLink_timesync_message(int(self.vehicle.now * 1e9), message.ts1))

    def _file_transfer(self, link: PeerLink, message: Any) -> None:
        """There is no file system: a NAK lets MAVProxy fall back to PARAM_REQUEST_LIST at once."""
        request = bytes(message.payload)
        sequence = (int.from_bytes(request[0:2], "little") + 1) & 0xFFFF
        reply = bytearray(251)
        reply[0:2] = sequence.to_bytes(2, "little")
        reply[2], reply[3], reply[4], reply[5] = request[2], FTP_NAK, 1, request[3]
        reply[FTP_HEADER] = FTP_UNKNOWN_COMMAND
        sender = (message.get_srcSystem(), message.get_srcComponent())
        link.send(mavlink.MAVLink_file_transfer_protocol_message(0, *sender, list(reply)))
