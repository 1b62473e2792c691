"""What came of a rehearsal: for the terminal, for programs (JSON), for a build server (JUnit). Pure."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any
from xml.etree import ElementTree

from mavproxy_uavapi.rehearsal.record import Record
from mavproxy_uavapi.rehearsal.rules import RULES, Broken, nearest

FORMAT = 1  # of the JSON; members are added, none is taken away
WELL, FAILED, BROKEN, NOT_FLOWN = 0, 1, 2, 3


@dataclass(frozen=True)
class Rehearsed:
    """One flight: what went wrong in it by order, its record, what it has broken, and its seed."""

    faults: tuple[str, ...]
    record: Record
    broken: tuple[Broken, ...]
    seed: int = 0

    @property
    def status(self) -> int:
        """The exit status: what was broken counts more than how the file ended; it may fail where anything does."""
        if self.not_judged:
            return NOT_FLOWN
        return BROKEN if self.broken else FAILED if self.record.failure and not self.faults else WELL

    @property
    def not_judged(self) -> list[str]:
        """Why it shows nothing."""
        return [f"{fault} never began: its moment did not come" for fault in self.record.missed]

    @property
    def broken_rules(self) -> list[str]:
        """The names of the rules that were broken, in the order of time."""
        return [one.rule for one in self.broken]

    @property
    def name(self) -> str:
        """Which flight it is."""
        name = " and ".join(self.faults) or "nothing goes wrong"
        return f"{name}, seed {self.seed}" if self.seed else name


def status_of(outcomes: Sequence[Rehearsed]) -> int:
    """The exit status of all flights."""
    return max(outcome.status for outcome in outcomes)


def lines(outcome: Rehearsed) -> list[str]:
    """What a person wants to know, a line each."""
    record = outcome.record
    verdict = {WELL: "well", FAILED: "the file failed", BROKEN: "broken", NOT_FLOWN: "cannot be judged"}[
        outcome.status
    ]
    told = [f"{record.file}, {outcome.name}: {verdict}"]
    for system, samples in record.samples.items():
        end = samples[-1] if samples else None
        way = f"{record.distance(system):.0f} m in {record.duration:.0f} s, up to {record.highest(system):.0f} m"
        battery = "" if end is None or end.battery is None else f", {end.battery:.0f} % of the battery left"
        where = "" if end is None else f"; ends {'in the air' if end.armed else 'disarmed'} in {end.mode}"
        told.append(f"  vehicle {system}: {way}{battery}{where}")
    told += [f"  {reason}" for reason in outcome.not_judged]
    if record.failure:
        told.append(f"  the file: {record.failure}")
    told += [f"  {line}" for line in _losses(record)]
    told += [f"  {one.rule}, vehicle {one.system} at {one.at:.0f} s: {one.sentence}" for one in outcome.broken]
    return told


def _losses(record: Record) -> Iterator[str]:
    """Where each vehicle would end if something were lost, a line for each of them."""
    kinds = {(loss.system, loss.what) for loss in record.losses}
    for system, what in sorted(kinds):
        losses = [loss for loss in record.losses if (loss.system, loss.what) == (system, what)]
        word = {"link": "the link or the companion", "gps": "the GPS"}[what]
        landed = [record.from_start(loss) for loss in losses if not loss.armed]
        down = [f"it lands at most {max(landed):.0f} m from its start"] if landed else []
        up = [loss for loss in losses if loss.armed]
        if up:
            at = ", ".join(f"{loss.at:.0f}" for loss in up)
            down.append(f"it stays up, in {' or '.join(sorted({loss.mode for loss in up}))}, if that is at {at} s")
        yield f"vehicle {system} without {word} ({len(losses)} of its moments): {'; '.join(down)}"


def as_json(outcomes: Sequence[Rehearsed]) -> str:
    """All of it; lengths in m, times in s on the vehicles' clocks."""
    return json.dumps(
        {"format": FORMAT, "status": status_of(outcomes), "flights": [_flight(one) for one in outcomes]}
    )


def _flight(outcome: Rehearsed) -> dict[str, Any]:
    record = outcome.record
    return {
        "file": record.file,
        "faults": list(outcome.faults),
        "seed": outcome.seed,
        "status": outcome.status,
        "broken": [asdict(one) for one in outcome.broken],
        "failure": record.failure,
        "exit_status": record.exit_status,
        "duration_s": round(record.duration, 1),
        "nearest": [
            {"vehicles": [first, second], "distance_m": round(distance, 2), "at_s": round(at, 1)}
            for distance, at, first, second in nearest(record)
        ],
        "vehicles": {
            str(system): {
                "distance_m": round(record.distance(system), 1),
                "highest_m": round(record.highest(system), 2),
                "columns": [
                    "at",
                    "lat",
                    "lon",
                    "height",
                    "speed",
                    "sinking",
                    "mode",
                    "armed",
                    "landed",
                    "battery",
                    "item",
                ],
                "samples": [[_rounded(value) for value in sample] for sample in samples],
            }
            for system, samples in record.samples.items()
        },
        "losses": [loss._asdict() for loss in record.losses],
        "commands": [asdict(asked) for asked in record.asked.values()],
        "events": [asdict(said) for said in record.said],
        "output": record.output,
    }


def _rounded(value: Any) -> Any:
    return round(value, 7) if isinstance(value, float) else value


def as_junit(outcomes: Sequence[Rehearsed]) -> str:
    """A test suite for each flight, and a case for each rule and for the file itself."""
    suites = ElementTree.Element("testsuites")
    for outcome in outcomes:
        failures = {one.rule: one.sentence for one in outcome.broken}
        if outcome.status == FAILED:
            failures["file"] = outcome.record.failure
        cases = ("file", *RULES)
        suite = ElementTree.SubElement(
            suites,
            "testsuite",
            name=outcome.name,
            tests=str(len(cases) + len(outcome.not_judged)),
            failures=str(len(failures)),
            errors=str(len(outcome.not_judged)),
        )
        for reason in outcome.not_judged:
            element = ElementTree.SubElement(suite, "testcase", classname=outcome.record.file, name="judged")
            ElementTree.SubElement(element, "error", message=reason)
        for case in cases:
            element = ElementTree.SubElement(suite, "testcase", classname=outcome.record.file, name=case)
            if case in failures:
                ElementTree.SubElement(element, "failure", message=failures[case])
    return ElementTree.tostring(suites, encoding="unicode", xml_declaration=True)
