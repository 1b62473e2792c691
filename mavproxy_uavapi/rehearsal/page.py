"""What came of a rehearsal as one HTML file: for a phone, and for paper. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape

from mavproxy_uavapi.rehearsal.record import METRES_PER_DEGREE, Record, Sample
from mavproxy_uavapi.rehearsal.report import Rehearsed, lines

WIDE, HIGH, EDGE = 640, 320, 24  # units of a drawing
MOST_POINTS = 1000  # of a line
COLOURS = ("#0060a8", "#b04a00", "#2f7d32", "#7b3fa0", "#a01845", "#00797a")
STYLE = """
body { font: 16px/1.4 system-ui, sans-serif; max-width: 44em; margin: auto; padding: 0 1em; }
svg { width: 100%; height: auto; border: 1px solid #999; } table { border-collapse: collapse; width: 100%; }
td, th { text-align: left; padding: .2em .6em .2em 0; border-bottom: 1px solid #ccc; vertical-align: top; }
td:first-child { white-space: nowrap; }
.wrong { color: #a00000; font-weight: 600; } .well { color: #1f6b23; font-weight: 600; }
pre { overflow: auto; background: #f4f4f4; padding: .6em; } @media print { section { break-inside: avoid; } }
"""

Points = Sequence[tuple[float, float]]


def as_html(outcomes: Sequence[Rehearsed]) -> str:
    """The whole page."""
    flights = "".join(_section(outcome) for outcome in outcomes)
    title = escape(f"Rehearsal of {outcomes[0].record.file}")
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{title}</title><style>{STYLE}</style><h1>{title}</h1>{flights}</html>"
    )


def _section(outcome: Rehearsed) -> str:
    head, *told = lines(outcome)
    kind = "well" if outcome.status == 0 else "wrong"
    record = outcome.record
    asked = [
        f"<tr><td>{one.at:.0f} s<td>{one.system}<td>{escape(one.verb)}<td>{escape(one.detail or one.state)}"
        for one in record.asked.values()
    ]
    said = [
        f"<tr><td>{one.at:.0f} s<td>{one.system}<td>{escape(one.kind)}<td>{escape(one.text)}" for one in record.said
    ]
    return (
        f'<section><h2>{escape(outcome.name)}</h2><p class="{kind}">{escape(head)}</p>'
        f"<ul>{''.join(f'<li>{escape(line.strip())}' for line in told)}</ul>"
        f"<h3>From above (north is up)</h3>{_drawing(_plan(record), 'm east', 'm north', equal=True)}"
        f"<h3>Height</h3>{_drawing(_heights(record), 's', 'm above home')}"
        f"<h3>Commands</h3><table><tr><th>at<th>vehicle<th>verb<th>answer{''.join(asked)}</table>"
        f"<h3>What was said</h3><table>{''.join(said)}</table>"
        f"<h3>Output</h3><pre>{escape(record.output[-4000:])}</pre></section>"
    )


def _thinned(samples: Sequence[Sample]) -> Sequence[Sample]:
    return samples[:: max(1, len(samples) // MOST_POINTS)]


def _plan(record: Record) -> list[Points]:
    """The ways over the ground: m east and north of the first vehicle's home."""
    first = next((samples[0] for samples in record.samples.values() if samples), None)
    if first is None:
        return []
    east = METRES_PER_DEGREE * math.cos(math.radians(first.lat))
    return [
        [((s.lon - first.lon) * east, (s.lat - first.lat) * METRES_PER_DEGREE) for s in _thinned(samples)]
        for samples in record.samples.values()
    ]


def _heights(record: Record) -> list[Points]:
    return [[(s.at, s.height) for s in _thinned(samples)] for samples in record.samples.values()]


def _drawing(curves: Sequence[Points], x_unit: str, y_unit: str, *, equal: bool = False) -> str:
    """The curves, with what their axes span."""
    points = [point for curve in curves for point in curve]
    if not points:
        return "<p>Nothing flew.</p>"
    (left, right), (low, high) = ((min(axis), max(axis)) for axis in zip(*points, strict=True))
    across, up = max(right - left, 1.0), max(high - low, 1.0)
    x_scale, y_scale = (WIDE - 2 * EDGE) / across, (HIGH - 2 * EDGE) / up
    if equal:
        x_scale = y_scale = min(x_scale, y_scale)
    drawn = "".join(
        f'<polyline fill="none" stroke-width="2" stroke="{COLOURS[number % len(COLOURS)]}" points="'
        + " ".join(f"{EDGE + (x - left) * x_scale:.1f},{HIGH - EDGE - (y - low) * y_scale:.1f}" for x, y in curve)
        + '"/>'
        for number, curve in enumerate(curves)
    )
    spans = f"{round(left)} to {round(right)} {x_unit}, {round(low)} to {round(high)} {y_unit}"
    return (
        f'<svg viewBox="0 0 {WIDE} {HIGH}" role="img" aria-label="{spans}">{drawn}'
        f'<text x="{EDGE}" y="{HIGH - 6}" font-size="14">{spans}</text></svg>'
    )
