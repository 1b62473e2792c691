"""Damaged files for every parser of foreign bytes: each ends in its own error, in bounded time.

    python benchmarks/fuzz_files.py --minutes 10 [--seed N]

The seeds are tests/corpus; tests/support/parsers.py lists the parsers, tests/support/damage.py the damage. It fails
when a parser ends in an error that is not its own, when Python's words reach a user, or when a file takes longer than
SLOW.
"""

from __future__ import annotations

import argparse
import random
import resource
import sys
import time
from collections import Counter
from pathlib import Path

from figures import machine, table

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.rules.test_corpus import PYTHONIC
from tests.support.damage import damaged
from tests.support.parsers import CORPUS, PARSERS, ForeignParser

SLOW = 2.0  # s of the processor for a file of at most 200 kB


def outcome(parser: ForeignParser, data: bytes) -> tuple[str, str]:
    """What became of a file, and what is wrong with that; empty if nothing is."""
    try:
        parser.summary(data)
    except parser.errors as error:
        return "refused", f"Python speaks: {error}" if PYTHONIC.search(str(error)) else ""
    except Exception as error:  # noqa: BLE001  what this looks for
        return "failed", repr(error)
    return "read", ""


def fuzz(minutes: float, dice: random.Random) -> tuple[list[list[str]], Counter[str]]:
    """A row for each parser, and what was found, with how often."""
    seeds = {
        name: [file.read_bytes() for file in sorted((CORPUS / p.folder).iterdir())] for name, p in PARSERS.items()
    }
    counts, slowest, found = Counter[tuple[str, str]](), Counter[str](), Counter[str]()
    end = time.monotonic() + 60.0 * minutes
    while time.monotonic() < end:
        for name, parser in PARSERS.items():
            data = damaged(dice.choice(seeds[name]), dice)
            began = time.process_time()
            what, wrong = outcome(parser, data)
            took = time.process_time() - began
            counts[name, what] += 1
            slowest[name] = max(slowest[name], took)
            if took > SLOW:
                wrong = f"it takes {took:.1f} s"
            if wrong:
                found[f"{name}: {wrong:.200}"] += 1
    rows = [
        [name, *(str(counts[name, what]) for what in ("read", "refused", "failed")), f"{1000 * slowest[name]:.0f}"]
        for name in PARSERS
    ]
    return rows, found


def main() -> int:
    """Run it; the exit status is 1 if something was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    rows, found = fuzz(options.minutes, random.Random(options.seed))
    head = ["parser", "read", "refused", "failed", "slowest ms"]
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(machine())
    print(table(head, rows))
    files = sum(int(cell) for row in rows for cell in row[1:4])
    print(f"{files} files in {options.minutes:g} minutes; {memory:.0f} MB at most")
    for what, count in found.most_common():
        print(f"{count} times {what}")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
