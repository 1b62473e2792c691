"""What patrol.py must do before it may fly. `pytest` finds `uav` by the package mavproxy-uavapi."""

import pytest

from mavproxy_uavapi.testing import landed_within

pytestmark = pytest.mark.uav(location="CMAC", envelope="field.geojson", battery=3000, reserve=30)


def test_patrol_comes_home(uav):
    uav.run("patrol.py")
    assert landed_within(uav, 1.0)
    assert max(sample.height for sample in uav.way) < 12


@pytest.mark.uav(wind="8,270", gps_noise=1.0)
def test_patrol_keeps_to_the_field_in_wind(uav):
    uav.run("patrol.py")


@pytest.mark.parametrize("fault", ["pilot_mode=LOITER@leg2", "link_loss@leg2:3s", "low_battery@leg2"])
def test_patrol_breaks_no_rule_when_something_goes_wrong(uav, fault):
    uav.run("patrol.py", faults=[fault])


def test_patrol_leaves_the_vehicle_to_its_pilot(uav):
    flight = uav.run("patrol.py", faults=["pilot_mode=LOITER@leg1"])
    assert flight.record.exit_status == 1
    assert uav.now.mode == "LOITER"
