"""Two vehicles: the prompt's commands go to the chosen one; two programs that know one vehicle only fly one each."""

from __future__ import annotations

import contextlib
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import requests

from tests.support.processes import Rig, eventually, free_port
from tests.support.several_vehicles import several_vehicles

pytestmark = pytest.mark.long

EXAMPLES = Path(__file__).parents[2] / "examples"
SIDES = {1: 6.0, 2: 10.0}  # m, by system id
HEIGHTS = {1: 5.0, 2: 8.0}  # m
TAKEOFF, LOCAL = 22, 1  # MAV_CMD_NAV_TAKEOFF, MAV_FRAME_LOCAL_NED
NEAR = 0.1  # m


@pytest.fixture(scope="module")
def rig_and_vehicles(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Rig, dict[int, Rig]]]:
    homes = ["-35.363261,149.165230,584,353", "-35.362261,149.165230,584,90"]  # 111 m apart
    directory = tmp_path_factory.mktemp("ports")
    with several_vehicles(directory, list(SIDES), speedup=10, homes=homes, arguments=["--streamrate=2"]) as made:
        yield made


def square(port: int, system: int) -> subprocess.Popen[str]:
    """A program that flies a square over the home of its vehicle."""
    size = [f"--side={SIDES[system]}", f"--altitude={HEIGHTS[system]}"]
    command = [sys.executable, "ned_square.py", "--url", f"http://127.0.0.1:{port}", *size]
    return subprocess.Popen(command, cwd=EXAMPLES, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def is_open(port: int) -> bool:
    with contextlib.suppress(requests.ConnectionError):
        return requests.get(f"http://127.0.0.1:{port}/telemetry/status", timeout=10).status_code == 200
    return False


def received(vehicle: Rig) -> list[dict[str, Any]]:
    messages: list[dict[str, Any]] = vehicle.control.ask("received", since=0)["messages"]
    return messages


def targets(vehicle: Rig) -> list[tuple[float, ...]]:
    """Where it was sent, m north, east and up; each once."""
    fields = [one["fields"] for one in received(vehicle) if one["name"] == "SET_POSITION_TARGET_LOCAL_NED"]
    return list(dict.fromkeys((round(one["x"]), round(one["y"]), round(-one["z"])) for one in fields))


def heights(vehicle: Rig) -> list[float]:
    """The heights of its takeoffs."""
    return [one["fields"]["param7"] for one in received(vehicle) if one["fields"].get("command") == TAKEOFF]


def test_command_after_another_in_one_line_is_for_the_vehicle_that_was_chosen_there(
    rig_and_vehicles: tuple[Rig, dict[int, Rig]],
) -> None:
    rig, _ = rig_and_vehicles
    for system in (2, 1, 2):
        assert f"vehicle {system}: copter" in rig.mavproxy.ask(f"vehicle {system};uavapi status", "in flight")
    rig.mavproxy.ask("vehicle 1;uavapi status", "in flight")


def test_each_program_flies_the_vehicle_of_its_port(rig_and_vehicles: tuple[Rig, dict[int, Rig]]) -> None:
    rig, vehicles = rig_and_vehicles
    ports = {1: rig.port, 2: free_port()}
    rig.mavproxy.type(f"uavapi set ports {','.join(f'{port}:{system}' for system, port in ports.items())}")
    eventually(lambda: is_open(ports[2]), what="the second port")
    programs = {system: square(port, system) for system, port in ports.items()}
    for program in programs.values():
        output, _ = program.communicate(timeout=240)
        assert program.returncode == 0, output
    for system, vehicle in vehicles.items():
        side, height = SIDES[system], HEIGHTS[system]
        corners = [(side, 0, height), (side, side, height), (0, side, height), (0, 0, height)]
        assert targets(vehicle) == corners
        assert heights(vehicle) == [height]
        eventually(lambda vehicle=vehicle: not vehicle.control.ask("state")["armed"], what="its landing")
        assert vehicle.control.ask("state")["position"] == pytest.approx([0, 0, 0], abs=1.0)
