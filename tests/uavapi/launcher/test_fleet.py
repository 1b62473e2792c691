from __future__ import annotations

import pytest

from mavproxy_uavapi.core.geodesy import offset
from mavproxy_uavapi.launcher import locations
from mavproxy_uavapi.launcher.fleet import fleet, kinds
from mavproxy_uavapi.launcher.options import RunOptions, parse


def test_fleet_has_types_system_ids_and_homes_in_a_row():
    options = RunOptions(simulated=True, sysid=3, vehicles=(("copter", 2), ("rover", 1)), spacing=10.0)
    home = locations.BUILT_IN["CMAC"]
    vehicles = fleet(options, home, [0, 4, 7])
    assert [(vehicle.kind, vehicle.sysid, vehicle.instance) for vehicle in vehicles] == [
        ("copter", 3, 0),
        ("copter", 4, 4),
        ("rover", 5, 7),
    ]
    assert vehicles[0].home == home
    north, east = offset(home.lat, home.lon, vehicles[2].home.lat, vehicles[2].home.lon)
    assert (north, east) == pytest.approx((0.0, 20.0), abs=0.05)


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--count", "3", "--vehicle", "rover"], ["rover"] * 3),
        (["--vehicles", "copter:2,plane"], ["copter", "copter", "plane"]),
        ([], ["copter"]),
    ],
)
def test_types_of_the_simulated_vehicles(arguments, expected):
    assert kinds(parse(["--simulated", *arguments], {})) == expected
