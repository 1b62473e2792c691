from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim import Options, Wind


def flight(new_ground, seed):
    ground = new_ground(Options(seed=seed, gps_noise=0.5, wind=Wind(3.0, 45.0)))
    ground.run(6.0)
    ground.mode(4)
    ground.arm()
    ground.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 10)
    ground.run(15.0)
    ground.local((30.0, -20.0, -15.0))
    states = []
    for _ in range(20):
        ground.run(0.5)
        states.append((ground.body.position, ground.body.velocity, ground.body.yaw))
    return states


def test_the_same_seed_and_inputs_give_the_same_flight(new_ground):
    assert flight(new_ground, 5) == flight(new_ground, 5)
    assert flight(new_ground, 5) != flight(new_ground, 6)


def test_speedup_is_a_live_parameter_and_stays_positive(ground):
    def set_speedup(value):
        ground.send(mavlink.MAVLink_param_set_message(1, 1, b"SIM_SPEEDUP", value, 9))
        return ground.simulator.speedup

    assert set_speedup(2.5) == 2.5
    assert set_speedup(0.0) == 1.0


def test_all_links_hear_texts_and_a_closed_one_no_more(ground):
    other = ground.simulator.open_link()
    ground.run(1.0)
    assert "STATUSTEXT" in {m.get_type() for m in other.messages()}
    ground.simulator.close_link(other)
    ground.run(1.0)
    assert other.messages() == []


def test_boot_texts_and_home_come_as_in_sitl(ground):
    ground.run(6.0)
    texts = ground.texts()
    assert texts[0].startswith("ArduCopter V4")
    assert texts.index("EKF3 IMU0 initialised") < texts.index("EKF3 IMU0 origin set")
    assert "Field Elevation Set: 584m" in texts
