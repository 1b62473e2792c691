"""Every example is rehearsed, with each of the usual faults: what came of it, a row of a table each.

    python benchmarks/rehearse_examples.py [--only square] [--runs 1]

Followers, and those that need a file of their own, are left out.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

EXAMPLES = Path(__file__).parents[1] / "examples"
FILES: dict[str, list[str]] = {
    "takeoff_land.py": [],
    "ned_square.py": [],
    "ned_square_polling.py": [],
    "polygon_ned.py": [],
    "polygon_drive.py": [],
    "delivery.py": [],
    "tag_landing.py": [],
    "aerpaw/square.py": [],
    "aerpaw/sweep.py": [],
    "tested/patrol.py": [],
    "mistakes/after_the_pilot.py": [],
    "mistakes/no_end.py": [],
    "mistakes/through_the_mast.py": ["--envelope", str(EXAMPLES / "mistakes" / "field.geojson")],
}
WORDS = ("well", "the file failed", "broken", "cannot be judged")  # by status
RUN = [sys.executable, "-c", "from mavproxy_uavapi.commands import main; raise SystemExit(main())", "run"]


def rehearse(name: str, options: list[str], runs: int) -> None:
    """Print a row for each flight of an example."""
    with tempfile.TemporaryDirectory(prefix="rehearsed-") as folder:
        report = Path(folder, "report.json")
        copy = shutil.copytree(EXAMPLES, Path(folder, "examples"))  # they write logs beside themselves
        command = [*RUN, str(copy / name), "--location=CMAC", "--faults=all", f"--runs={runs}", *options]
        done = subprocess.run(
            [*command, f"--report={report}"], check=False, capture_output=True, text=True, cwd=folder
        )
        if not report.exists():
            print(f"| {name} | | not flown | {done.stderr.strip()} |", flush=True)
            return
        for flight in json.loads(report.read_text(encoding="utf-8"))["flights"]:
            fault, rules = " ".join(flight["faults"]) or "none", ", ".join(one["rule"] for one in flight["broken"])
            seconds, why = flight["duration_s"], flight["failure"]
            print(f"| {name} | {fault} | {WORDS[flight['status']]} | {rules} | {seconds:.0f} | {why} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="examples with that in their name")
    parser.add_argument("--runs", type=int, default=1, help="of each flight, with the next seed each time (1)")
    given = parser.parse_args()
    print("| example | fault | verdict | rules | s | the script |")
    print("| --- | --- | --- | --- | --- | --- |")
    for name, options in FILES.items():
        if given.only in name:
            rehearse(name, options, given.runs)


if __name__ == "__main__":
    main()
