"""The texts at the prompt, made from the report of `GET /gradys/status`. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mavproxy_uavapi.core.text import joined

Report = Mapping[str, Any]


def status(report: Report) -> str:
    """A few lines: each station, each vehicle, the readings."""
    lines = ["gradys: " + ("running" if report["running"] else "stopped; `gradys start`")]
    for station in report["stations"]:
        lines += station_lines(station)
    if not report["stations"]:
        lines.append("no ground station is set; `gradys set gs HOST:PORT`")
    lines += readings_lines(report)
    return joined(lines)


def station_lines(station: Report) -> list[str]:
    """A ground station, and each vehicle whose positions it gets."""
    dropped = station["dropped_by_station"]
    lines = [
        f"ground station {station['station']}: {station['sent']} sent, {station['acknowledged']} acknowledged"
        f" ({dropped} of them dropped by the station{': no browser watches' if dropped else ''}),"
        f" {station['failed']} failed{trips(station['round_trip_ms'])}"
    ]
    if station["ip"]:
        lines.append(f"  our address for it: {station['ip']}")
    if station["note"]:
        lines.append(f"  {station['note']}")
    lines += error_lines(station)
    for system, vehicle in station["vehicles"].items():
        lines.append(f"  vehicle {system}: {vehicle_line(vehicle)}")
    if not station["vehicles"]:
        lines.append("  no vehicle was heard yet")
    return lines


def vehicle_line(vehicle: Report) -> str:
    """The outcome of one vehicle's updates."""
    if vehicle["why_not"]:
        return f"nothing to send: {vehicle['why_not']} (next is {vehicle['seq']})"
    age = vehicle["acknowledged_age_s"]
    newest = "none acknowledged yet" if age is None else f"last one acknowledged {age:.1f} s ago"
    return f"next is {vehicle['seq']}, {newest}"


def error_lines(report: Report) -> list[str]:
    """The last error of a station or sink, and the time to the next try."""
    lines = []
    if report["last_error"]:
        age = report.get("last_error_age_s")
        lines.append("  last error" + (f" {age:.0f} s ago" if age is not None else "") + f": {report['last_error']}")
    if report["next_try_s"] is not None:
        lines.append(f"  next try in {report['next_try_s']:.1f} s")
    return lines


def readings_lines(report: Report) -> list[str]:
    """The spool, the sinks, the quantities."""
    if not report["sinks"] and report["spool"] is None:
        return ["readings: no sink is set; `gradys set sink http://HOST/readings` or mqtt://HOST/TOPIC"]
    oldest, unsent = report["oldest_unsent_s"], report["spooled"]
    lines = [
        f"readings: {'?' if unsent is None else unsent} unsent"
        + (f", the oldest {oldest:.1f} s old" if oldest is not None else "")
    ]
    spool = report["spool"]
    if spool is not None:
        lines += spool_lines(spool)
    for sink in report["sinks"]:
        counts = f"{sink['acknowledged']} acknowledged of {sink['sent']} sent, in {sink['batches']} batches"
        lines += [f"sink {sink['sink']}: {counts}{trips(sink['round_trip_ms'])}", *error_lines(sink)]
        if sink["put_last"]:
            lines.append(f"  {sink['put_last']} times one was refused alone: it is sent when there is nothing else")
    for quantity in report["quantities"]:
        by_vehicle = "; ".join(f"vehicle {system}: {why}" for system, why in quantity["why_not"].items())
        why = quantity["problem"] or by_vehicle
        taken = f"  {quantity['quantity']} every {quantity['period_s']:g} s: {quantity['taken']} taken"
        lines.append(taken + (f" ({why})" if why else ""))
    return lines


def spool_lines(spool: Report) -> list[str]:
    """The state of the spool."""
    lines = [f"  kept in {spool['file']}"]
    if spool["problem"]:
        lines.append(f"  NOT KEPT just now: {spool['problem']}")
    dropped = {cause: count for cause, count in spool["dropped"].items() if count}
    if dropped:
        lines.append("  dropped: " + ", ".join(f"{count} by {cause}" for cause, count in sorted(dropped.items())))
    lines += [f"  a corrupt file was set aside: {file}" for file in spool["set_aside"]]
    return lines


def trips(summary: Mapping[str, float] | None) -> str:
    """Round-trip times, as the end of a line."""
    if summary is None:
        return ""
    return f"; round trip {summary['last']:.1f} ms (median {summary['median']:.1f}, p95 {summary['p95']:.1f})"


def stats(report: Report) -> str:
    """A table with one row per station and vehicle."""
    head = ("station", "vehicle", "sent", "acked", "dropped", "failed", "withheld", "seq")
    rows = [
        (
            station["station"],
            system,
            *(str(v[name]) for name in ("sent", "acknowledged", "dropped_by_station", "failed", "withheld", "seq")),
        )
        for station in report["stations"]
        for system, v in station["vehicles"].items()
    ]
    widths = [max(map(len, column)) for column in zip(head, *rows, strict=True)]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in (head, *rows)]
    return joined([*(line.rstrip() for line in lines), *readings_lines(report)])
