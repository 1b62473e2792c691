import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.support.simulated import place
from tests.uavapi.sim.conftest import READY

ACCEPTED = mavlink.MAV_MISSION_ACCEPTED


def item(seq, command, place=(0, 0), z=0.0, parameters=(0, 0, 0, 0), frame=3):
    return mavlink.MAVLink_mission_item_int_message(1, 1, seq, frame, command, 0, 1, *parameters, *place, z, 0)


def upload(ground, items):
    """Send the items as they are asked for; the type of the final ack."""
    ground.send(mavlink.MAVLink_mission_count_message(1, 1, len(items), 0))
    for _ in range(len(items) + 1):
        heard = ground.run(0.01)
        acks = [m for m in heard if m.get_type() == "MISSION_ACK"]
        if acks:
            return acks[0].type
        for request in (m for m in heard if m.get_type() == "MISSION_REQUEST"):
            ground.send(items[request.seq])
    return None


def simple_mission(ground):
    return [
        item(0, 16, place(ground, 0, 0), 584.0, frame=0),
        item(1, 22, z=10.0),
        item(2, 16, place(ground, 40, 0), 10.0),
        item(3, 178, parameters=(1, 4, 0, 0)),
        item(4, 183, parameters=(9, 1700, 0, 0)),
        item(5, 16, place(ground, 40, 30), 15.0, (2, 0, 0, 0)),
        item(6, 20),
    ]


def arm_with(ground, mission):
    """Ready and armed in GUIDED, with that mission."""
    ground.run(READY)
    assert upload(ground, mission) == ACCEPTED
    ground.mode(4)
    ground.arm()


def begin(ground, mission):
    """As `arm_with`, and it flies the mission."""
    arm_with(ground, mission)
    ground.command(mavlink.MAV_CMD_MISSION_START)


def test_upload_and_download_keep_the_items(ground):
    ground.run(6.0)
    assert upload(ground, simple_mission(ground)) == ACCEPTED
    ground.send(mavlink.MAVLink_mission_request_list_message(1, 1, 0))
    ground.run(0.01)
    assert ground.of("MISSION_COUNT")[-1].count == 7
    ground.send(mavlink.MAVLink_mission_request_int_message(1, 1, 5, 0))
    ground.send(mavlink.MAVLink_mission_request_message(1, 1, 5, 0))
    ground.run(0.01)
    as_int, as_float = ground.of("MISSION_ITEM_INT")[-1], ground.of("MISSION_ITEM")[-1]
    assert (as_int.command, as_int.x, as_int.y) == (16, *place(ground, 40, 30))
    assert as_float.x == pytest.approx(as_int.x / 1e7, abs=1e-5)


def test_a_mission_flies_from_takeoff_to_disarming(ground):
    arm_with(ground, simple_mission(ground))
    assert ground.command(mavlink.MAV_CMD_MISSION_START) == mavlink.MAV_RESULT_ACCEPTED
    ground.run(120.0)
    assert [m.seq for m in ground.of("MISSION_ITEM_REACHED")] == [1, 2, 5]
    assert "Mission: 1 Takeoff" in ground.texts()
    assert ground.copter.servos.pulses(1000)[8] == 1700
    assert not ground.copter.armed
    assert (ground.body.north, ground.body.east) == pytest.approx((0.0, 0.0), abs=0.5)


def test_a_waypoint_delay_is_waited_at_a_standstill(ground):
    mission = simple_mission(ground)[:2] + [item(2, 16, place(ground, 30, 0), 10.0, (5, 0, 0, 0))]
    begin(ground, mission)
    ground.run(60.0)
    assert [m.seq for m in ground.of("MISSION_ITEM_REACHED")] == [1, 2]
    assert ground.body.north == pytest.approx(30.0, abs=0.2)
    assert ground.copter.armed


def test_conditions_and_jumps(ground):
    mission = [
        *simple_mission(ground)[:2],
        item(2, 16, place(ground, 10, 0), 10.0, (1, 0, 0, 0)),
        item(3, 177, parameters=(2, 1, 0, 0)),
        item(4, 112, parameters=(3, 0, 0, 0)),
        item(5, 183, parameters=(9, 1234, 0, 0)),
        item(6, 21),
    ]
    begin(ground, mission)
    ground.run(70.0)
    assert [m.seq for m in ground.of("MISSION_ITEM_REACHED")][:3] == [1, 2, 2]
    assert ground.copter.servos.pulses(1000)[8] == 1234
    assert not ground.copter.armed


def test_auto_on_the_ground_waits_for_the_throttle_or_mission_start(ground):
    arm_with(ground, simple_mission(ground))
    assert ground.mode(3) == 0
    ground.run(5.0)
    assert ground.body.down == 0.0
    ground.command(mavlink.MAV_CMD_MISSION_START)
    ground.run(5.0)
    assert ground.body.down < 0.0


def test_with_the_option_auto_takes_off_without_the_throttle(ground):
    ground.run(6.0)
    upload(ground, simple_mission(ground))
    ground.send(mavlink.MAVLink_param_set_message(1, 1, b"AUTO_OPTIONS", 2, 6))
    ground.mode(4)
    ground.arm()
    assert ground.mode(3) == 0
    ground.run(8.0)
    assert ground.body.down < 0.0


def test_with_both_options_a_vehicle_armed_in_auto_takes_off(ground):
    ground.run(6.0)
    upload(ground, simple_mission(ground))
    ground.send(mavlink.MAVLink_param_set_message(1, 1, b"AUTO_OPTIONS", 3, 6))
    assert ground.mode(3) == 0
    ground.run(0.02)
    assert "Mission: 1 Takeoff" in ground.texts()
    ground.run(2.0)
    assert ground.copter.mission.current == 1
    assert ground.arm() == mavlink.MAV_RESULT_ACCEPTED
    ground.run(8.0)
    assert ground.body.down < 0.0


def test_a_vehicle_disarmed_in_auto_begins_again_when_it_is_armed(ground):
    ground.run(6.0)
    upload(ground, simple_mission(ground))
    ground.send(mavlink.MAVLink_param_set_message(1, 1, b"AUTO_OPTIONS", 3, 6))
    ground.mode(3)
    ground.arm()
    ground.run(1.0)
    ground.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0)
    ground.run(1.0)
    assert ground.copter.mission.current == 0
    ground.arm()
    ground.run(8.0)
    assert ground.body.down < 0.0


def test_mission_start_in_auto_repeats_a_mission_that_is_complete(ground):
    begin(ground, simple_mission(ground)[:3])
    ground.run(40.0)
    assert [m.seq for m in ground.of("MISSION_ITEM_REACHED")] == [1, 2]
    ground.heard.clear()
    assert ground.command(mavlink.MAV_CMD_MISSION_START) == mavlink.MAV_RESULT_ACCEPTED
    ground.run(20.0)
    assert [m.seq for m in ground.of("MISSION_ITEM_REACHED")] == [1, 2]


def test_the_mission_frame_means_amsl(ground):
    ground.run(6.0)
    mission = simple_mission(ground)[:2] + [item(2, 16, place(ground, 0, 0), 604.0, frame=2)]
    assert upload(ground, mission) == ACCEPTED
    ground.send(mavlink.MAVLink_mission_request_int_message(1, 1, 2, 0))
    ground.run(0.01)
    assert ground.of("MISSION_ITEM_INT")[-1].frame == mavlink.MAV_FRAME_GLOBAL
    ground.mode(4)
    ground.arm()
    ground.command(mavlink.MAV_CMD_MISSION_START)
    ground.run(30.0)
    assert ground.body.down == pytest.approx(-20.0, abs=0.3)


def test_auto_on_the_ground_wants_a_takeoff_first(ground):
    arm_with(ground, [simple_mission(ground)[0], item(1, 16, place(ground, 10, 0), 10.0)])
    assert ground.command(mavlink.MAV_CMD_MISSION_START) == mavlink.MAV_RESULT_FAILED
    ground.run(0.02)
    assert "Auto: Missing Takeoff Cmd" in ground.texts()


def test_set_current_goes_to_that_item(ground):
    begin(ground, simple_mission(ground))
    ground.run(20.0)
    ground.send(mavlink.MAVLink_mission_set_current_message(1, 1, 5))
    ground.run(0.02)
    assert ground.of("MISSION_CURRENT")[-1].seq == 5
    assert ground.copter.mission.current == 5
    assert ground.command(mavlink.MAV_CMD_DO_SET_MISSION_CURRENT, 77) == mavlink.MAV_RESULT_DENIED


def test_a_mission_can_be_paused_left_and_resumed(ground):
    begin(ground, simple_mission(ground))
    while ground.copter.mission.current < 2:
        ground.run(0.5)
    ground.run(3.0)
    assert ground.command(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 0) == mavlink.MAV_RESULT_ACCEPTED
    ground.run(12.0)
    held = ground.body.position
    ground.run(3.0)
    assert ground.body.position == pytest.approx(held, abs=0.1)
    assert ground.command(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 1) == mavlink.MAV_RESULT_ACCEPTED
    ground.mode(17)
    ground.run(3.0)
    ground.mode(3)
    assert ground.copter.mission.current == 2
    ground.run(30.0)
    assert 5 in [m.seq for m in ground.of("MISSION_ITEM_REACHED")]


def test_clear_empties_the_list_but_not_while_it_runs(ground):
    ground.run(6.0)
    upload(ground, simple_mission(ground))
    ground.send(mavlink.MAVLink_mission_clear_all_message(1, 1, 0))
    assert ground.run(0.01)[0].type == ACCEPTED
    assert not ground.copter.mission.items
    upload(ground, simple_mission(ground))
    ground.mode(4)
    ground.arm()
    ground.command(mavlink.MAV_CMD_MISSION_START)
    ground.run(10.0)
    ground.send(mavlink.MAVLink_mission_clear_all_message(1, 1, 0))
    acks = [m for m in ground.run(0.01) if m.get_type() == "MISSION_ACK"]
    assert acks[0].type == mavlink.MAV_MISSION_ERROR


def test_bad_uploads_are_refused(ground):
    ground.run(6.0)
    bad = simple_mission(ground)
    bad[2] = item(2, 30000)
    assert upload(ground, bad) == mavlink.MAV_MISSION_UNSUPPORTED
    bad[2] = item(2, 16, (950000000, 0), 10.0)
    assert upload(ground, bad) == mavlink.MAV_MISSION_INVALID_PARAM5_X
    bad[2] = item(2, 16, place(ground, 1, 0), 10.0, (math.nan, 0, 0, 0))
    assert upload(ground, bad) == mavlink.MAV_MISSION_INVALID_PARAM1
    bad[2] = item(2, 16, place(ground, 1, 0), 10.0, frame=1)
    assert upload(ground, bad) == mavlink.MAV_MISSION_UNSUPPORTED_FRAME
    ground.send(mavlink.MAVLink_mission_count_message(1, 1, 10000, 0))
    ground.run(0.01)
    assert ground.of("MISSION_ACK")[-1].type == mavlink.MAV_MISSION_NO_SPACE
    ground.send(mavlink.MAVLink_mission_request_int_message(1, 1, 50, 0))
    ground.run(0.01)
    assert ground.of("MISSION_ACK")[-1].type == mavlink.MAV_MISSION_INVALID_SEQUENCE


def test_an_abandoned_upload_is_requested_again_and_then_cancelled(ground):
    ground.run(6.0)
    ground.send(mavlink.MAVLink_mission_count_message(1, 1, 3, 0))
    ground.run(9.5)
    assert len(ground.of("MISSION_REQUEST")) > 5
    assert ground.of("MISSION_ACK")[-1].type == mavlink.MAV_MISSION_OPERATION_CANCELLED


def test_fence_and_rally_lists_are_kept_apart(ground):
    ground.send(mavlink.MAVLink_mission_count_message(1, 1, 1, mavlink.MAV_MISSION_TYPE_RALLY))
    ground.send(mavlink.MAVLink_mission_item_int_message(1, 1, 0, 3, 5100, 0, 1, 0, 0, 0, 0, 1, 2, 3.0, 2))
    ground.send(mavlink.MAVLink_mission_request_list_message(1, 1, mavlink.MAV_MISSION_TYPE_RALLY))
    ground.send(mavlink.MAVLink_mission_request_list_message(1, 1, mavlink.MAV_MISSION_TYPE_MISSION))
    ground.run(0.01)
    assert [(m.mission_type, m.count) for m in ground.of("MISSION_COUNT")] == [(2, 1), (0, 0)]


def send_list(ground, kind, *items):
    """Hand a fence or rally points over; the last answer, a MAV_MISSION_RESULT."""
    ground.send(mavlink.MAVLink_mission_count_message(1, 1, len(items), kind))
    for seq, (command, param1, x, y, z) in enumerate(items):
        head = (1, 1, seq, 3, command, 0, 1, param1, 0, 0, 0)
        ground.send(mavlink.MAVLink_mission_item_int_message(*head, x, y, z, kind))
    ground.run(0.01)
    return ground.of("MISSION_ACK")[-1].type


CORNERS = [(5001, 3, x, y, 0.0) for x, y in ((0, 0), (0, 900), (900, 0))]
ERROR, ACCEPTED = mavlink.MAV_MISSION_ERROR, mavlink.MAV_MISSION_ACCEPTED


@pytest.mark.parametrize(
    ("items", "result", "text"),
    [
        (CORNERS, ACCEPTED, None),
        (CORNERS[:2], ERROR, "Incorrect item count"),
        ([*CORNERS[:2], (5002, 3, 9, 9, 0.0)], ERROR, "Received incorrect vertex type"),
        ([*CORNERS[:2], (5001, 4, 9, 9, 0.0)], ERROR, "Unexpected vertex count want=3 got=4"),
        ([*CORNERS[:2], (5003, 4, 9, 9, 0.0)], ERROR, "Received incorrect type"),
        ([(5001, 2, 1, 1, 0.0)], ERROR, "Invalid vertex count (2)"),
        ([(5004, 0, 1, 1, 0.0)], ERROR, "Non-positive circle radius"),
        ([(5000, 0, 1, 1, 0.0)] * 2, ERROR, "Multiple return points"),
        ([(5004, 9, 910000000, 1, 0.0)], ERROR, "Bad lat or lon"),
        ([(5004, 9, 1, 1, 0.0)] * 52, ERROR, "Fence exceeds storage size"),
        ([(5001, 256, 1, 1, 0.0)], mavlink.MAV_MISSION_INVALID_PARAM1, None),
        ([(16, 0, 1, 1, 0.0)], mavlink.MAV_MISSION_UNSUPPORTED, None),
    ],
)
def test_a_fence_is_taken_whole_or_not_at_all(ground, items, result, text):
    former = [(5003, 50, 1, 1, 0.0)]
    assert send_list(ground, mavlink.MAV_MISSION_TYPE_FENCE, *former) == ACCEPTED
    assert send_list(ground, mavlink.MAV_MISSION_TYPE_FENCE, *items) == result
    assert text is None or text in [message.text for message in ground.of("STATUSTEXT")]
    held = ground.simulator.missions.items(mavlink.MAV_MISSION_TYPE_FENCE)
    assert [one.command for one in held] == [one[0] for one in (items if result == ACCEPTED else former)]


def test_a_rally_point_keeps_whole_metres_and_is_counted(ground):
    assert send_list(ground, mavlink.MAV_MISSION_TYPE_RALLY, (5100, 0, 10, 20, 30.9)) == ACCEPTED
    (point,) = ground.simulator.missions.items(mavlink.MAV_MISSION_TYPE_RALLY)
    assert (point.z, ground.simulator.parameters["RALLY_TOTAL"]) == (30.0, 1)
    assert send_list(ground, mavlink.MAV_MISSION_TYPE_RALLY, (5100, 0, 910000000, 20, 3)) != ACCEPTED


def test_an_upload_that_fails_leaves_a_cut_mission(ground):
    ground.run(6.0)
    assert len(ground.copter.mission.items) == 1
    upload(ground, simple_mission(ground))
    bad = simple_mission(ground)[:3]
    bad[2] = item(2, 30000)
    upload(ground, bad)
    assert len(ground.copter.mission.items) == 3


def flown(ground, *items, seconds=60.0):
    """Fly items behind a takeoff to 10 m; the NED places each 0.1 s, from the end of the takeoff on."""
    mission = [*simple_mission(ground)[:2], *(one(seq) for seq, one in enumerate(items, 2))]
    begin(ground, mission)
    for _ in range(300):
        ground.run(0.1)
        if ground.copter.mission.current > 1:
            break
    track = []
    for _ in range(round(10 * seconds)):
        ground.run(0.1)
        track.append(tuple(ground.body.position))
    return track


def at(ground, command, north=0, east=0, z=10.0, **more):
    return lambda seq: item(seq, command, place(ground, north, east) if north or east else (0, 0), z, **more)


@pytest.mark.parametrize("frame", [0, 2, 3])
def test_a_copter_keeps_its_height_where_an_item_has_none(ground, frame):
    track = flown(
        ground, at(ground, 16, 30, 0, 0.0, frame=frame), at(ground, 19, 30, 20, 0.0, frame=frame), seconds=30
    )
    assert track[-1] == pytest.approx((30, 20, -10), abs=0.5)
    assert min(-down for _, _, down in track) > 9.0


@pytest.mark.parametrize(("turns", "radius", "leaves"), [(1, 15.0, -1), (2, -15.0, -1), (0.5, 15.0, 1)])
def test_copter_circles_from_the_nearest_point_to_where_its_turns_end(ground, turns, radius, leaves):
    circle = at(ground, 18, 40, 0, parameters=(turns, 0, radius, 0))
    track = flown(ground, circle, at(ground, 19, 0, 0, 10.0, parameters=(60, 0, 0, 0)), seconds=90)
    away = [math.hypot(north - 40, east) for north, east, _ in track if north > 24.5]
    assert max(away) < 17.5 and min(away) > 12.5
    assert track[-1][0] == pytest.approx(40 + 15 * leaves, abs=3.0)
    first = next(east for north, east, _ in track if abs(east) > 2 and north > 24)
    assert (first < 0) is (radius > 0), "clockwise from its south goes west"


def test_a_copter_goes_there_before_it_changes_its_height(ground):
    track = flown(ground, at(ground, 31, 30, 0, 25.0), at(ground, 93, parameters=(60, 0, 0, 0)), seconds=40)
    assert track[-1] == pytest.approx((30, 0, -25), abs=0.5)
    assert max(-down for north, _, down in track if north < 25) > 12.0, "it climbs on its way, too"


def test_a_copter_places_a_payload_and_climbs_again(ground):
    track = flown(ground, at(ground, 94, 20, 0, 3.0), at(ground, 16, 40, 0, 10.0), seconds=60)
    assert min(-down for _, _, down in track) == pytest.approx(0.6, abs=0.4)
    assert track[-1] == pytest.approx((40, 0, -10), abs=0.5)


def test_jump_tags_lead_to_the_first_of_a_number_and_loops_count_anew(ground):
    back = at(ground, 601, z=0.0, parameters=(7, 1, 0, 0))
    tag = at(ground, 600, z=0.0, parameters=(7, 0, 0, 0))
    flown(
        ground,
        tag,
        at(ground, 16, 10, 0),
        at(ground, 16, 0, 0, 10.0),
        back,
        at(ground, 177, z=0.0, parameters=(2, 1, 0, 0)),
    )
    reached = [m.seq for m in ground.of("MISSION_ITEM_REACHED")]
    assert reached.count(3) == 4, "two rounds, twice"
    assert ground.copter.mission.jumps_left == {}


def test_a_jump_to_nowhere_ends_the_mission(ground):
    flown(ground, at(ground, 177, z=0.0, parameters=(99, -1, 0, 0)), at(ground, 16, 50, 0), seconds=10)
    assert ground.copter.mission.state.name == "COMPLETE" and abs(ground.body.position[0]) < 1.0


def test_a_copter_passes_over_what_it_cannot_do_and_takes_items_of_cameras(ground):
    skipped = [at(ground, command, 0, 0, 5.0) for command in (30, 83, 213, 206, 2000, 531, 211, 189, 188, 1000)]
    track = flown(ground, *skipped, at(ground, 16, 20, 0), seconds=20)
    assert track[-1] == pytest.approx((20, 0, -10), abs=0.5)


def test_a_battery_is_counted_anew_after_a_change(ground):
    ground.run(6.0)
    ground.copter.battery.consumed = 3000.0
    assert ground.command(mavlink.MAV_CMD_BATTERY_RESET, 1, 80) == mavlink.MAV_RESULT_ACCEPTED
    assert ground.copter.battery.remaining == 80
    assert ground.command(mavlink.MAV_CMD_BATTERY_RESET, 2, 10) == mavlink.MAV_RESULT_ACCEPTED
    assert ground.copter.battery.remaining == 80
