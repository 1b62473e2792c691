"""A hostile client against the envelope, on the embedded copter in lock step and on ArduPilot's."""

from __future__ import annotations

import random
from collections.abc import Iterator
from typing import Any

import pytest

from mavproxy_uavapi.core.airspace import braking, formats
from mavproxy_uavapi.core.airspace.space import Space, outside_by
from mavproxy_uavapi.core.oversight.envelope_watch import CORRIDOR
from tests.support.envelopes import field, place
from tests.support.hostile import LATER, Attacks, Tally
from tests.support.processes import SPEEDUP, Rig, ardupilot
from tests.support.wired_rig import WiredRig

HALF, MAST, SPEED, ACCELERATION = 100.0, 50.0, 12.0, 5.0
COMMANDS = {"lockstep": 60, "ardupilot": 500}
SITL_SPEEDUP = 4  # a stop takes its time on our clock, too
LOOK = 0.1  # s of the vehicle's clock between looks
FREE = ("RTL", "LAND")


@pytest.fixture(scope="module", params=["lockstep", pytest.param("ardupilot", marks=pytest.mark.sitl)])
def besieged(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple[Any, int, float]]:
    """A rig, how many commands it gets, and how much faster than its own clock its vehicle's is."""
    directory = tmp_path_factory.mktemp(request.param)
    if request.param == "lockstep":
        rig: Rig = WiredRig(directory)
        yield rig, COMMANDS[request.param], SPEEDUP
    else:
        rig = ardupilot(directory, speedup=SITL_SPEEDUP, max_jobs=1000)
        yield rig, COMMANDS[request.param], SITL_SPEEDUP
    rig.stop()


def test_hostile_client_does_not_get_the_vehicle_out_by_more_than_the_bound(besieged: tuple[Any, int, float]) -> None:
    rig, commands, speedup = besieged
    body = field(HALF, MAST, speed=SPEED, climb=5, descent=3)
    space = Space(formats.of_geojson(body, "the envelope"))
    frame, rules = space.frame(place(0, 0)), space.rules(None)
    rig.in_the_air(15)
    assert rig.call("PUT", "/envelope", json=body).status_code == 200
    dice, tally, worst, freely_out = random.Random(7), Tally(), 0.0, False
    client = Attacks(dice, HALF, MAST)
    for number in range(commands):
        method, path, content = client.command()
        sent = {"data": content.encode()} if isinstance(content, str) else {"json": content}
        answer = rig.call(method, path + ("&" if "?" in path else "?") + "wait=false", **sent)
        tally.note(answer.status_code, answer.json())
        for _ in range(max(int(dice.choice(LATER) / LOOK), 1)):
            at = rig.ok(rig.get("/telemetry/gps"))["info"]["position"]
            by = outside_by(frame.spot((at["lat"], at["lon"]), at["relative_alt"]), rules)
            mode = rig.status()["mode"]
            freely_out = by > 0.0 and (freely_out or mode in FREE)
            worst = worst if freely_out else max(worst, by)
            rig.pass_time(LOOK / speedup)
        if number % 5 == 0 and rig.status()["mode"] != "GUIDED":
            revive(rig)
    bound = braking.overshoot(braking.of_brake({}), SPEED, ACCELERATION, LOOK + braking.LATENCY + 0.5, CORRIDOR)
    print(f"{commands} commands: {dict(tally)}; outside by {worst:.2f} m at most, the bound is {bound:.1f} m")
    assert worst <= bound
    assert rig.call("DELETE", "/envelope").status_code == 200


def revive(rig: Rig) -> None:
    """Bring it up and into GUIDED again, by the API."""
    flies = rig.status()["landed_state"] != "on_ground"
    for path in ("/command/guided",) if flies else ("/command/guided", "/command/arm", "/command/takeoff?alt=15"):
        rig.get(path)
