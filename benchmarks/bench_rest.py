"""What our modules cost while nobody calls: processor time and memory, and how long they take to load.

Each case has a MAVProxy and an embedded vehicle of its own, in turns with a MAVProxy without our modules. The time to
load runs from the line at the prompt until HTTP has answered.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
import urllib.error
import urllib.request
from pathlib import Path

from figures import cpu_seconds, machine, percentile, put_first, table
from rig import harness

from tests.support.ports import free_port

ALONE = "MAVProxy alone"
CASES: dict[str, tuple[str, ...]] = {
    ALONE: (),
    "uavapi": ("uavapi",),
    "uavapi, gradys": ("uavapi", "gradys"),
    "uavapi, gradys, vision": ("uavapi", "gradys", "vision"),
}
DEFAULT_RATE = "--streamrate=4"
SETTLED_AFTER = 4.0  # s: the parameters have been loaded


class Rest:
    """What was measured of one case, by round."""

    def __init__(self) -> None:
        self.cpu: list[float] = []  # share of a core
        self.memory: list[float] = []  # MB
        self.loading: list[float] = []  # s


def memory(pid: int) -> float:
    """The resident memory of a process, in MB."""
    lines = Path(f"/proc/{pid}/status").read_text(encoding="ascii").splitlines()
    return int(next(line.split()[1] for line in lines if line.startswith("VmRSS"))) / 1024


def answers(port: int) -> bool:
    """Whether HTTP answers."""
    try:
        urllib.request.urlopen(f"http://127.0.0.1:{port}/vehicles", timeout=1).close()
    except urllib.error.HTTPError:
        return True
    except OSError:
        return False
    return True


def load(rig: harness.Rig, modules: tuple[str, ...]) -> float:
    """Load the modules at the prompt, uavapi first; s until its first answer."""
    began = time.monotonic()
    for module in modules:
        setting = f':{{"port":{rig.port}}}' if module == "uavapi" else ""
        rig.mavproxy.type(f"module load {module}{setting}")
        if module == "uavapi":
            while not answers(rig.port):
                time.sleep(0.002)
            took = time.monotonic() - began
    return took


def measure(modules: tuple[str, ...], rest: Rest, seconds: float, first: bool) -> None:
    """One round of one case."""
    with tempfile.TemporaryDirectory(prefix="uavapi-rest-") as directory:
        rig = harness.Rig(Path(directory), free_port())
        try:
            instance = harness.start_embedded(rig, speedup=1)
            rig.mavproxy = rig.start("mavproxy", harness.mavproxy_command(instance, DEFAULT_RATE, logs=True))
            rig.mavproxy.says("Received")
            if first:
                put_first(*(process.pid for process in rig.processes))
            if modules:
                rest.loading.append(load(rig, modules))
            time.sleep(SETTLED_AFTER)
            before = cpu_seconds(rig.mavproxy.pid)
            time.sleep(seconds)
            rest.cpu.append((cpu_seconds(rig.mavproxy.pid) - before) / seconds)
            rest.memory.append(memory(rig.mavproxy.pid))
        finally:
            rig.stop()


def main() -> int:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=6.0, help="of each case in each round")
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--first", action="store_true", help="run before the machine's other work (root)")
    options = parser.parse_args()
    print(f"rest: {machine()}")
    cases = {name: Rest() for name in CASES}
    for _ in range(options.rounds):
        for name, rest in cases.items():
            measure(CASES[name], rest, options.seconds, options.first)
    alone = cases[ALONE]
    rows = []
    for name, rest in cases.items():
        cpu, size = percentile(rest.cpu, 0.5), percentile(rest.memory, 0.5)
        row = [name, f"{100 * cpu:.1f} %", f"{cpu / percentile(alone.cpu, 0.5):.2f}", f"{size:.1f}"]
        row += [f"{size / percentile(alone.memory, 0.5):.2f}"]
        rows.append([*row, f"{percentile(rest.loading, 0.5):.2f}" if rest.loading else ""])
    print(table(["at rest", "processor", ": alone", "MB", ": alone", "loading, s"], rows))
    print()
    return 0


if __name__ == "__main__":
    sys.exit(main())
