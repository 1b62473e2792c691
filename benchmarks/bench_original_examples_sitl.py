"""Flies the example programs of the original service, unchanged, through our launcher: how many of their runs fail.

    python benchmarks/bench_original_examples_sitl.py EXAMPLES [--ardupilot ~/ardupilot] [--runs 10] [--only NAME]

EXAMPLES is the folder `flight_examples` of its source distribution. Without `--ardupilot` the embedded vehicle flies.
Each program gets a freshly started vehicle and flies its runs in a row there. A run fails when the program does not
end with status 0, says that something failed, or leaves the vehicle armed.
"""

from __future__ import annotations

import argparse
import contextlib
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import rig
from figures import machine, table

from tests.support.ports import free_port

SPEEDUP = 8
PROGRAMS = {  # program: its speed-up
    "takeoff_land/takeoff_land.py": SPEEDUP,
    "ned_square/ned_square.py": SPEEDUP,
    "ned_square_polling/ned_square_polling.py": SPEEDUP,
    "go_to_polygon/go_to_polygon.py": SPEEDUP,
    "drive_polygon/drive_polygon.py": SPEEDUP,
    "gps_follower/gps_follower.py": SPEEDUP,
    "delivery/delivery_simulation.py": 1,  # it sleeps for 8 s between arming and take-off, ArduPilot disarms after 10
}
FOLLOWER = "gps_follower/gps_follower.py"
FOLLOWS_FOR = 8.0  # s until Ctrl-C, which sends it home
LONGEST = 600.0  # s of a run
FAILURES = ("failed", "error", "timed out", "timeout", "traceback")  # in what a program says


class Launched(rig.harness.Rig):  # type: ignore[misc]
    """A vehicle and its MAVProxy, as `mavproxy-uavapi --simulated` starts them."""

    def __init__(self, directory: Path, speedup: int, ardupilot: str | None) -> None:
        super().__init__(directory, free_port())
        command = [str(rig.harness.SCRIPTS / "mavproxy-uavapi"), "--simulated", "--headless", f"--port={self.port}"]
        command += [f"--speedup={speedup}", f"--log_path={directory}", f"--location={rig.harness.HOME}"]
        if ardupilot is not None:
            command.append(f"--ardupilot_path={ardupilot}")
        self.launcher = self.start("launcher", command)

    def stop(self) -> None:
        """SIGTERM, upon which it ends what it has started."""
        self.launcher.popen.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.launcher.popen.wait(40)
        super().stop()


@contextlib.contextmanager
def launched(name: str, speedup: int, ardupilot: str | None) -> Iterator[Launched]:
    """A vehicle that is up."""
    with tempfile.TemporaryDirectory(prefix=f"uavapi-{name}-") as directory:
        made = Launched(Path(directory), speedup, ardupilot)
        try:
            made.wait_until_up(120)
            yield made
        except BaseException:
            print(made.launcher.output()[-3000:], file=sys.stderr)
            raise
        finally:
            made.stop()


def fly(program: Path, vehicle: Launched, leader: Launched | None) -> str:
    """One run; why it failed, or nothing."""
    command = [sys.executable, "-u", str(program), "--url", f"127.0.0.1:{vehicle.port}"]
    if leader is not None:
        command += ["--leader-url", f"127.0.0.1:{leader.port}"]
    running = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert running.stdout is not None
    printed = ""
    if leader is not None:
        for line in running.stdout:
            printed += line
            if "FOLLOWING" in line:
                break
        time.sleep(FOLLOWS_FOR)
        running.send_signal(signal.SIGINT)
    try:
        printed += running.communicate(timeout=LONGEST)[0]
    except subprocess.TimeoutExpired:
        running.kill()
        return f"not done within {LONGEST:g} s: {running.communicate()[0][-200:]}"
    if running.returncode or any(word in printed.lower() for word in FAILURES):
        return f"status {running.returncode}: {' | '.join(printed.strip().splitlines()[-3:])} {last_error(vehicle)}"
    status = vehicle.status()
    return "" if not status["armed"] else f"it left the vehicle armed, {status['landed_state']} in {status['mode']}"


def last_error(vehicle: Launched) -> str:
    """What the newest verb that failed was told, which these programs do not print."""
    failed = [job for job in vehicle.get("/jobs").json()["jobs"] if job["error"]]
    return f"[{failed[-1]['verb']}: {failed[-1]['error']}]" if failed else ""


def down(vehicle: Launched) -> None:
    """Leave it fit for the next run, however this one ended."""
    vehicle.get("/command/land")


def runs(examples: Path, name: str, count: int, ardupilot: str | None) -> list[str]:
    """Why each run failed; an empty text for one that did not."""
    speedup, outcomes = PROGRAMS[name], []
    with contextlib.ExitStack() as stack:
        vehicle = stack.enter_context(launched("own", speedup, ardupilot))
        leader: Any = None
        if name == FOLLOWER:
            leader = stack.enter_context(launched("leader", speedup, ardupilot))
            leader.in_the_air(10)
        for run in range(count):
            if leader is not None:
                leader.ok(leader.post("/movement/drive", x=30 * (-1) ** run, y=0, z=0))
            before = time.monotonic()
            why = fly(examples / name, vehicle, leader)
            print(f"{name} {run + 1}: {time.monotonic() - before:.0f} s {why or 'well'}", flush=True)
            outcomes.append(why)
            if why:
                down(vehicle)
    return outcomes


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("examples", type=Path)
    parser.add_argument("--ardupilot", help="a built copy of ArduPilot; without it the embedded vehicle flies")
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--only", action="append", choices=[Path(name).stem for name in PROGRAMS])
    arguments = parser.parse_args()
    rows, failed = [], 0
    for name, speedup in PROGRAMS.items():
        if arguments.only and Path(name).stem not in arguments.only:
            continue
        outcomes = runs(arguments.examples, name, arguments.runs, arguments.ardupilot)
        reasons = [why for why in outcomes if why]
        failed += len(reasons)
        rows.append(
            [Path(name).stem, f"{speedup}", f"{len(outcomes)}", f"{len(reasons)}", "; ".join(dict.fromkeys(reasons))]
        )
    print(machine())
    print(table(["program", "speed-up", "runs", "failed", "why"], rows))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
