"""Landings through a real MAVProxy on a simulated vehicle that already runs, ArduPilot's SITL for one.

    python benchmarks/bench_vision_sitl.py --master tcp:127.0.0.1:5760 [--landings 20] [--method velocity]

The camera is `sim`, fed by the vehicle's SIM_STATE, which is the truth that touchdowns are measured by too. Each
landing begins about 6 m up and up to 2.5 m beside the tag, in wind of up to 5 m/s, with a camera latency of 50 to
250 ms.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import random
import socket
import statistics
import subprocess
import sys
import sysconfig
import tempfile
import time
from pathlib import Path
from typing import Any

import requests

MAVPROXY = [sys.executable, str(Path(sysconfig.get_path("scripts"), "mavproxy.py"))]
ON_TAG = 0.20  # m


class Session:
    """A MAVProxy with uavapi and vision."""

    def __init__(self, master: str) -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = int(probe.getsockname()[1])
        self.url = f"http://127.0.0.1:{self.port}"
        load = f'module load uavapi:{{"port":{self.port}}}; module load vision'
        self.log = tempfile.TemporaryFile()  # noqa: SIM115  closed with the process
        command = [*MAVPROXY, f"--master={master}", f"--cmd={load}", "--state-basedir=" + tempfile.mkdtemp()]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=self.log, stderr=subprocess.STDOUT)

    def type(self, line: str) -> None:
        """At the prompt."""
        assert self.process.stdin is not None
        self.process.stdin.write(line.encode() + b"\n")
        self.process.stdin.flush()

    def get(self, path: str, **query: Any) -> Any:
        """A GET's body."""
        return requests.get(self.url + path, params=query, timeout=200).json()

    def post(self, path: str, **body: Any) -> Any:
        """A POST's body."""
        return requests.post(self.url + path, json=body, timeout=300).json()

    def ready(self) -> None:
        """Wait until the vehicle is known and may be armed."""
        deadline = time.monotonic() + 120
        while time.monotonic() < deadline:
            with contextlib.suppress(requests.ConnectionError):
                if self.get("/telemetry/status").get("info", {}).get("ready_to_arm"):
                    return
            time.sleep(1.0)
        raise SystemExit("the vehicle did not get ready to arm")

    def stop(self) -> None:
        """End it; a MAVProxy that waits for a line heeds its end rather than a signal."""
        assert self.process.stdin is not None
        self.process.stdin.close()
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


def fly(session: Session, seed: int, method: str, fps: float) -> dict[str, Any]:
    """One landing."""
    chance = random.Random(seed)
    distance, bearing = 2.5 * math.sqrt(chance.random()), chance.uniform(0, 2 * math.pi)
    case: dict[str, Any] = {
        "seed": seed,
        "method": method,
        "wind": chance.uniform(0, 5),
        "latency": chance.uniform(50, 250),
        "offset": distance,
    }
    place = f"{distance * math.cos(bearing):.2f},{distance * math.sin(bearing):.2f},{chance.uniform(0, 360):.0f}"
    for line in (
        f"param set SIM_WIND_SPD {case['wind']:.2f}",
        f"param set SIM_WIND_DIR {chance.uniform(0, 360):.0f}",
        f"vision set fps {fps:g}",
        f"vision set sim_latency {case['latency']:.0f}",
        f"vision set latency {case['latency']:.0f}",
        f"vision set sim_tags 0:0.30@{place}",
        "vision set source sim",
    ):
        session.type(line)
        time.sleep(0.4)
    session.ready()
    for answer in (session.get("/command/arm"), session.get("/command/takeoff", alt=6)):
        if "result" not in answer:
            return {**case, "failed": str(answer), "error": math.inf}
    answer = session.post("/vision/land", method=method)
    report = answer.get("info", {})
    case.update({name: report.get(name) for name in ("attempts", "duration", "phases", "last_offset")})
    case["error"] = report.get("touchdown_error", math.inf) if "result" in answer else math.inf
    if "result" not in answer:
        case["failed"] = answer.get("detail", str(answer))
        session.get("/command/land")
    return case


def main() -> int:
    """Fly and print a line of the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--master", required=True)
    parser.add_argument("--landings", type=int, default=20)
    parser.add_argument("--first", type=int, default=1, help="first seed")
    parser.add_argument("--method", choices=("velocity", "landing_target"), default="velocity")
    parser.add_argument("--fps", type=float, default=15)
    parser.add_argument("--json", type=Path, help="append each landing there")
    chosen = parser.parse_args()
    session = Session(chosen.master)
    cases = []
    try:
        session.ready()
        for seed in range(chosen.first, chosen.first + chosen.landings):
            case = fly(session, seed, chosen.method, chosen.fps)
            cases.append(case)
            print(f"{chosen.method} {seed}: {case.get('failed') or case['error']}", file=sys.stderr, flush=True)
            if chosen.json:
                with chosen.json.open("a", encoding="utf-8") as stream:
                    stream.write(json.dumps(case) + "\n")
    finally:
        session.stop()
    errors = sorted(case["error"] for case in cases)
    on_tag = sum(error <= ON_TAG for error in errors) / len(errors)
    high = errors[math.ceil(0.95 * len(errors)) - 1]
    print(f"{chosen.method}: {len(errors)} landings, {100 * on_tag:.0f} % within {ON_TAG:g} m, ", end="")
    print(f"median {statistics.median(errors):.3f} m, 95 % {high:.3f} m")
    return 0 if on_tag >= 0.98 else 1


if __name__ == "__main__":
    sys.exit(main())
