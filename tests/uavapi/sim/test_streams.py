import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim.streams import GROUPS, Streams, group_of
from mavproxy_uavapi.sim.telemetry import TelemetryMessages

ATTITUDE = mavlink.MAVLINK_MSG_ID_ATTITUDE
SET_INTERVAL = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
GET_INTERVAL = mavlink.MAV_CMD_GET_MESSAGE_INTERVAL


def count(messages, name):
    return sum(message.get_type() == name for message in messages)


def stream(ground, group, rate):
    ground.send(mavlink.MAVLink_request_data_stream_message(1, 1, group, rate, 1))


def test_before_anybody_asks_there_are_only_heartbeats(ground):
    ground.run(6.0)
    heard = {message.get_type() for message in ground.run(5.0)}
    assert heard == {"HEARTBEAT"}


@pytest.mark.parametrize("rate", [1, 4, 10, 25])
def test_interval_rates_are_honoured(ground, rate):
    assert ground.command(SET_INTERVAL, ATTITUDE, 1e6 / rate) == 0
    ground.run(1.0)
    assert count(ground.run(10.0), "ATTITUDE") == pytest.approx(10 * rate, abs=1)


def test_a_stream_request_sets_all_messages_of_the_stream(ground):
    ground.run(6.0)
    stream(ground, mavlink.MAV_DATA_STREAM_ALL, 4)
    ground.run(0.5)
    heard = ground.run(10.0)
    for names in GROUPS.values():
        for name in names:
            if name != "POSITION_TARGET_GLOBAL_INT":
                assert count(heard, name) == pytest.approx(40, abs=1), name
    assert count(heard, "EXTENDED_SYS_STATE") == 0


def test_a_later_stream_request_overrides_an_interval(ground):
    ground.command(SET_INTERVAL, ATTITUDE, 40000)
    stream(ground, mavlink.MAV_DATA_STREAM_ALL, 4)
    ground.run(1.0)
    assert count(ground.run(5.0), "ATTITUDE") == pytest.approx(20, abs=1)
    ground.command(SET_INTERVAL, ATTITUDE, 40000)
    assert count(ground.run(5.0), "ATTITUDE") == pytest.approx(125, abs=2)


def test_streams_are_per_link(ground):
    other = ground.simulator.open_link()
    ground.command(SET_INTERVAL, ATTITUDE, 100000)
    ground.run(2.0)
    assert {message.get_type() for message in other.messages()} <= {"HEARTBEAT", "STATUSTEXT"}


def test_intervals_can_be_read_stopped_and_set_to_the_default(ground):
    def reported():
        ground.heard.clear()
        ground.command(GET_INTERVAL, ATTITUDE)
        return ground.of("MESSAGE_INTERVAL")[0].interval_us

    assert reported() == -1
    ground.command(SET_INTERVAL, ATTITUDE, 250000)
    assert reported() == 250000
    ground.command(SET_INTERVAL, ATTITUDE, -1)
    assert reported() == -1
    ground.send(mavlink.MAVLink_param_set_message(1, 1, b"MAV1_EXTRA1", 5.0, 4))
    ground.command(SET_INTERVAL, ATTITUDE, 0)
    assert reported() == 200000
    assert ground.command(SET_INTERVAL, 4242, 1000000) == mavlink.MAV_RESULT_DENIED
    assert ground.command(SET_INTERVAL, ATTITUDE, 1000) == mavlink.MAV_RESULT_DENIED


def test_the_default_is_the_rate_that_a_stream_was_requested_last(ground):
    stream(ground, mavlink.MAV_DATA_STREAM_ALL, 4)
    ground.command(SET_INTERVAL, ATTITUDE, 40000)
    ground.command(SET_INTERVAL, ATTITUDE, 0)
    ground.run(1.0)
    assert count(ground.run(5.0), "ATTITUDE") == pytest.approx(20, abs=1)
    stream(ground, 99, 10)
    ground.command(SET_INTERVAL, ATTITUDE, 0)
    assert count(ground.run(5.0), "ATTITUDE") == pytest.approx(20, abs=1)


def test_a_late_caller_is_not_flooded():
    streams = Streams()
    streams.set("ATTITUDE", 0.1, 0.0)
    assert "ATTITUDE" in streams.due(0.0)
    assert streams.due(5.0).count("ATTITUDE") == 1
    assert streams.due(5.05) == []


def test_every_streamed_message_can_be_built(ground):
    telemetry = TelemetryMessages(ground.copter, 0.0)
    for names in GROUPS.values():
        for name in names:
            assert telemetry.knows(name)
            assert group_of(name) is not None
