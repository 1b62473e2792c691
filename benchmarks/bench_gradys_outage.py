"""A receiver that is down for minutes: does everything arrive, once each, in order, and how soon?

A real MAVProxy on the embedded vehicle samples the position at 1 Hz; a program posts ten readings a second. The
receiver is ended, started again after `--minutes`, and then asked what it has.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import requests
from rig import harness

from tests.support.ports import free_port

RATE = 10  # posted readings per second


def post_for(rig: Any, session: requests.Session, seconds: float) -> list[int]:
    """Post readings at RATE; their numbers."""
    numbers: list[int] = []
    began = time.monotonic()
    for turn in range(round(seconds * RATE)):
        time.sleep(max(0.0, began + turn / RATE - time.monotonic()))
        body = {"quantity": "temperature", "value": turn, "representation": "degC"}
        answer = session.post(f"{rig.url}/gradys/readings", json=body, timeout=30)
        answer.raise_for_status()
        numbers += answer.json()["seq"]
    return numbers


def main() -> int:
    """Run it; 0 when nothing was lost, repeated or late."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--minutes", type=float, default=1.0, help="how long the receiver is down (%(default)g)")
    minutes = arguments.parse_args().minutes
    with tempfile.TemporaryDirectory() as name:
        return run(harness, Path(name), minutes * 60)


def run(tools: Any, directory: Path, seconds: float) -> int:
    """One outage of so many seconds."""
    rig = tools.embedded(directory, "--sysid=10", speedup=1, logs=True)
    try:
        port = free_port()
        command = [sys.executable, "-m", "mavproxy_gradys.station", f"--port={port}", f"--database={directory}/s.db"]
        url = f"http://127.0.0.1:{port}/readings"
        settings = {"sink": url, "spool": f"{directory}/spool.db", "quantities": "position@1"}
        line = "module load gradys:" + json.dumps(settings, separators=(",", ":"))
        rig.mavproxy.ask(line, "Loaded module gradys")
        tools.eventually(lambda: rig.get("/gradys/status").status_code == 200, 10, "the module")
        with requests.Session() as session:
            posted = post_for(rig, session, seconds)
        status = rig.get("/gradys/status").json()["info"]
        taken = status["quantities"][0]["taken"]
        back = time.monotonic()
        rig.start("station", command).says("listening on")
        expected = len(posted) + taken
        answer = tools.eventually(lambda: arrived(url, expected), 120, "everything's arrival")
        took = time.monotonic() - back
    finally:
        rig.stop()
    numbers = [reading["seq"] for reading in answer["readings"]]
    times = [reading["received"] for reading in answer["readings"]]
    lost = set(posted) - set(numbers)
    in_order = times == sorted(times)
    print(f"outage {seconds:g} s: {len(posted)} posted and {taken} positions = {expected} readings")
    print(f"  arrived {len(numbers)}, lost {len(lost)}, once each: {len(numbers) == len(set(numbers))}", end="")
    print(f" (repeats that the receiver dropped: {answer['repeats']}), in order: {in_order}")
    print(f"  all there {took:.1f} s after the receiver's start")
    return int(bool(lost) or not in_order or took > 30)


def arrived(url: str, expected: int) -> dict[str, Any] | None:
    """What the receiver has, once it has that many readings."""
    try:
        if requests.get(url, params={"limit": 1}, timeout=5).json()["count"] < expected:
            return None
        answer: dict[str, Any] = requests.get(url, params={"limit": 1_000_000}, timeout=30).json()
    except requests.ConnectionError:
        return None
    return answer


if __name__ == "__main__":
    sys.exit(main())
