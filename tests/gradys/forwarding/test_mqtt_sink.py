"""The topics, and brokers that are too slow; end_to_end/test_gradys_mqtt.py has a real one."""

from __future__ import annotations

import asyncio
import gc
from types import SimpleNamespace
from typing import Any

import aiomqtt
import pytest
from paho.mqtt.client import topic_matches_sub

from mavproxy_gradys import settings
from mavproxy_gradys.errors import NotDelivered
from mavproxy_gradys.forwarding import mqtt_sink
from mavproxy_gradys.forwarding.mqtt_sink import MqttSink, status_topic, topic_of
from mavproxy_gradys.forwarding.readings import Reading, Stored
from tests.support.virtual_time import FastLoop

ALT = Reading("uav-7", 7, "alt", "m", 1.0, 0.0)


@pytest.mark.parametrize(
    "template,topic,status",
    [
        ("fleet/{sysid}/{quantity}", "fleet/7/alt", "fleet/7/status"),
        ("{device}/{quantity}/raw", "uav-7/alt/raw", "uav-7/status/raw"),
        ("everything", "everything", "everything/status"),
    ],
)
def test_topics(template: str, topic: str, status: str) -> None:
    assert topic_of(template, ALT) == topic
    assert status_topic(template, ALT) == status


def test_default_topic_is_the_one_that_listeners_for_nearby_take() -> None:
    topic = topic_of(mqtt_sink.DEFAULT_TOPIC, Reading("north-7", 7, "position", "", [1, 2, 3], 0.0))
    assert topic_matches_sub(settings.HEARD_TOPIC, topic)


class Broker:
    """In the place of aiomqtt's clients: makes them, and answers as slowly as a test wants.

    Attributes:
        connects, publishes: s that each takes.
        refuses: topic that it refuses.
        made: how many clients there were.
        client_ids: the ids that they gave themselves.
        properties: of the last one's CONNECT.
        open: connections that nobody has closed.
        output: (topic, retained) of what was published.
    """

    def __init__(self) -> None:
        self.connects = self.publishes = 0.0
        self.refuses = ""
        self.made = self.open = 0
        self.client_ids: list[str] = []
        self.properties: Any = None
        self.output: list[tuple[str, bool]] = []

    def client(self, *_: Any, identifier: str, properties: Any, **__: Any) -> Client:
        self.made += 1
        self.properties = properties
        self.client_ids.append(identifier)
        return Client(self)


class Client:
    def __init__(self, broker: Broker) -> None:
        self._broker = broker
        self._client = SimpleNamespace(socket=lambda: None)
        self._disconnected = asyncio.get_running_loop().create_future()

    async def __aenter__(self) -> Client:
        await asyncio.sleep(self._broker.connects)
        self._broker.open += 1
        return self

    async def __aexit__(self, *_: Any) -> None:
        self._broker.open -= 1

    async def publish(self, topic: str, _payload: Any, qos: int, retain: bool, properties: Any = None) -> None:
        await asyncio.sleep(self._broker.publishes)
        if topic == self._broker.refuses:
            raise aiomqtt.MqttError("refused")
        self._broker.output.append((topic, retain))


@pytest.fixture
def broker(monkeypatch: pytest.MonkeyPatch) -> Broker:
    broker = Broker()
    monkeypatch.setattr(aiomqtt, "Client", broker.client)
    return broker


@pytest.fixture
def sink(loop: FastLoop) -> MqttSink:
    return MqttSink("mqtt://127.0.0.1/fleet/{sysid}/{quantity}", 3.0, "")


def sent(loop: FastLoop, sink: MqttSink, *readings: Reading) -> Any:
    batch = [Stored(number, reading) for number, reading in enumerate(readings or (ALT,), 1)]
    return loop.run(sink.send(batch))


def test_each_connection_says_online_and_closes_with_offline(loop: FastLoop, sink: MqttSink, broker: Broker) -> None:
    assert sent(loop, sink) == {1}
    loop.run(sink.close())
    assert broker.output == [("fleet/7/status", True), ("fleet/7/alt", False), ("fleet/7/status", True)]
    assert broker.open == 0


@pytest.mark.parametrize("station_confirms", [False, True])
def test_the_broker_delivers_no_large_packets_where_the_sink_listens(
    loop: FastLoop, broker: Broker, station_confirms: bool
) -> None:
    broker.refuses = "fleet/7/status"  # it gets no farther than to its connection
    with pytest.raises(NotDelivered):
        sent(loop, MqttSink("mqtt://127.0.0.1/fleet/{sysid}/{quantity}", 3.0, "", station_confirms))
    assert getattr(broker.properties, "MaximumPacketSize", 0) == (64 * 1024 if station_confirms else 0)


def test_only_where_a_vehicle_is_stays_with_the_broker(loop: FastLoop, sink: MqttSink, broker: Broker) -> None:
    sent(loop, sink, *(Reading(device, 7, "position", "", [1, 2, 3], 0.0) for device in ("uav-7", "buoy")))
    assert sorted(broker.output[1:]) == [("fleet/7/position", False), ("fleet/7/position", True)]


def test_only_a_vehicle_of_our_own_name_stays_with_the_broker(loop: FastLoop, broker: Broker) -> None:
    sink = MqttSink("mqtt://127.0.0.1/fleet/{device}/{quantity}", 3.0, "", device="north")
    sent(loop, sink, *(Reading(device, 7, "position", "", [1, 2, 3], 0.0) for device in ("uav-7", "north-7")))
    assert sorted(output for output in broker.output if output[0].endswith("position")) == [
        ("fleet/north-7/position", True),
        ("fleet/uav-7/position", False),
    ]


def test_vehicles_of_two_machines_with_one_system_id_share_no_topic(loop: FastLoop, broker: Broker) -> None:
    topics = []
    for name in ("north", "south"):
        broker.output.clear()
        sink = MqttSink("mqtt://127.0.0.1", 3.0, "", device=name)
        sent(loop, sink, Reading(f"{name}-7", 7, "position", "", [1, 2, 3], 0.0))
        topics.append(sorted(broker.output))
    assert topics == [
        [("fleet/north-7/position", True), ("fleet/north-7/status", True)],
        [("fleet/south-7/position", True), ("fleet/south-7/status", True)],
    ]


def test_readings_of_all_devices_of_a_vehicle_take_one_connection(loop: FastLoop, broker: Broker) -> None:
    sink = MqttSink("mqtt://127.0.0.1", 3.0, "")
    sent(loop, sink, ALT, *(Reading(f"buoy-{n}", 7, "depth", "m", 2.0, 0.0) for n in range(5)))
    assert (broker.made, broker.output[0]) == (1, ("fleet/uav-7/status", True))


def test_late_connection_is_closed_and_meanwhile_none_is_made(loop: FastLoop, sink: MqttSink, broker: Broker) -> None:
    broker.connects = 20.0
    began = loop.time()
    for why in ("no answer within 3 s", "has not ended yet", "has not ended yet"):
        with pytest.raises(NotDelivered, match=why):
            sent(loop, sink)
    assert (loop.time() - began, broker.made) == (pytest.approx(3.0), 1)
    loop.pass_time(18)
    assert broker.open == 0
    broker.connects = 0.0
    assert sent(loop, sink) == {1}
    assert (broker.made, broker.open) == (2, 1)


def test_who_is_cancelled_while_connecting_leaves_no_connection(
    loop: FastLoop, sink: MqttSink, broker: Broker
) -> None:
    broker.connects = 2.0
    sending = loop.create_task(sink.send([Stored(1, ALT)]))
    loop.pass_time(1)
    sending.cancel()
    loop.pass_time(2)
    assert (broker.made, broker.open) == (1, 0)
    loop.run(sink.close())


def test_a_connection_that_cannot_say_online_is_none(loop: FastLoop, sink: MqttSink, broker: Broker) -> None:
    broker.refuses = "fleet/7/status"
    with pytest.raises(NotDelivered, match="refused"):
        sent(loop, sink)
    loop.settle()
    assert broker.open == 0
    broker.refuses = ""
    assert sent(loop, sink) == {1}
    assert broker.output[0] == ("fleet/7/status", True)


def test_one_vehicle_finds_out_that_the_broker_is_not_there(loop: FastLoop, sink: MqttSink, broker: Broker) -> None:
    broker.connects = 20.0
    with pytest.raises(NotDelivered):
        sent(loop, sink, *(Reading(f"uav-{n}", n, "alt", "m", 1.0, 0.0) for n in range(1, 101)))
    assert broker.made == 1
    loop.pass_time(20)


def test_a_new_connection_ends_the_one_before_at_the_broker(loop: FastLoop, sink: MqttSink, broker: Broker) -> None:
    """By the same client id. Else its will says `offline` once the broker misses it, after the new one's `online`."""
    other = Reading("uav-8", 8, "alt", "m", 1.0, 0.0)
    sent(loop, sink, ALT, other)
    for topic in ("fleet/7/alt", "fleet/8/alt"):
        broker.refuses = topic
        sent(loop, sink, ALT, other)
    broker.refuses = ""
    sent(loop, sink, ALT, other)
    seven, eight = broker.client_ids[:2]
    assert broker.client_ids == [seven, eight, seven, eight] and seven != eight


@pytest.mark.parametrize("publishes", [0, 1])
def test_of_a_broker_that_hangs_up_no_library_logs_anything(publishes: int, caplog: pytest.LogCaptureFixture) -> None:
    """It accepts the connection, acknowledges so many messages, and then closes.

    Their loggers have no handler, so that Python puts what they warn of into the pilot's terminal.
    """

    async def hang_up(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readuntil(b"\x00\x04MQTT")
        writer.write(bytes.fromhex("20020000"))  # CONNACK
        for number in range(publishes):
            await reader.readuntil(b"online")
            writer.write(bytes((0x40, 2, 0, number + 1)))  # PUBACK
        await reader.read(100)
        writer.close()

    async def sent() -> None:
        server = await asyncio.start_server(hang_up, "127.0.0.1", 0)
        port = server.sockets[0].getsockname()[1]
        sink = MqttSink(f"mqtt://127.0.0.1:{port}", 1.0, "")
        for _ in range(2):
            with pytest.raises(NotDelivered):
                await sink.send([Stored(1, ALT)])
        await sink.close()
        server.close()
        await asyncio.sleep(0.1)

    asyncio.run(sent())
    gc.collect()
    assert caplog.messages == []
