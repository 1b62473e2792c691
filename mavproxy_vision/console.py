"""The texts at the prompt. Pure."""

from __future__ import annotations

from mavproxy_uavapi.core.text import joined
from mavproxy_vision.landing.flight_jobs import FlightJobs
from mavproxy_vision.settings import SOURCES
from mavproxy_vision.status import in_view, status
from mavproxy_vision.tracking.tracker import Tracker

HELP = """\
vision status                      the camera, the tags in view, what is in flight
vision start | stop                open or close the camera; stop ends a flight too, and the vehicle holds
vision set [NAME [VALUE]]          show or change settings, such as: vision set source sim
vision config                      the settings in force, and where each came from
vision tags                        the tags in view
vision land [ID] [METHOD]          land on the tag from here (velocity or landing_target)
vision search [ID]                 fly an expanding square until the tag is in sight
vision mission [ALT NORTH EAST [ID|none]]   take off, fly there (m from home), land on the tag
vision abort                       end what is in flight; a vehicle that it flew is commanded to hold
vision calibrate FOLDER BOARD [FILE]        charuco:7x5:0.03:0.022 or chessboard:9x6:0.025
vision snapshot FILE               write the newest frame, with its tags drawn in
vision tag FILE.pdf [--family F] [--id N] [--size M]   a tag to scale, for printing
vision help                        this"""


def report(tracker: Tracker, flights: FlightJobs) -> str:
    """The same as a few lines."""
    body = status(tracker, flights)
    source = body["source"] or f"none; `vision set source` takes {SOURCES}"
    camera = f"camera {body['camera']}" + (f" ({body['error']})" if body["error"] else "")
    lines = [
        f"vision: source {source}: {camera}, {body['rate']} frames/s, {body['frames']} looked at, "
        f"{body['repeated']} repeated, {body['reconnects']} reconnects",
        f"AprilTags of {', '.join(body['families'])}: {tracker.settings.tags}; in view: {body['in_view'] or 'none'}",
    ]
    if body["controls"]:
        taken = ", ".join(f"{name} {value}" for name, value in body["controls"].items())
        lines.append(f"camera controls: {taken}")
    if body["detector_ms"] is not None:
        lines.append(f"detector {body['detector_ms']} ms, newest frame {1000 * body['frame_age_s']:.0f} ms old")
    if flights.report is not None:
        flight = flights.report
        activity = flights.phase if flights.running else flight.reason or flight.line()
        lines.append(f"{flight.verb}: {activity}; attempt {flight.attempts}, {flight.duration:.0f} s")
    return joined(lines)


def tags(tracker: Tracker) -> str:
    """A line for each tag in view."""
    result = tracker.fresh_result
    if result is None:
        return f"vision: no frames: {tracker.health.state}"
    if not result.detections:
        return "vision: no tags in view"
    lines = []
    for tag in in_view(result):
        if tag["position"] is None:
            lines.append(f"{tag['family']} {tag['id']}: of unknown size (`tags` does not list it)")
            continue
        right, down, ahead = tag["position"]
        lines.append(
            f"{tag['family']} {tag['id']}: {tag['distance']:.2f} m away; in the camera right {right:+.2f}, "
            f"down {down:+.2f}, ahead {ahead:.2f} m; hamming {tag['hamming']}, "
            f"error {tag['reprojection_error']:.2f} px, "
            f"{1000 * tag['latency_s']:.0f} ms after its light"
        )
    return joined(lines)


def caption(tracker: Tracker, flights: FlightJobs) -> list[str]:
    """The lines written into the annotated frame."""
    state = tracker.health.state
    lines = [
        f"{tracker.settings.shown_source}: {tracker.health.rate:.0f} frames/s"
        if state == "ok"
        else f"camera: {state}"
    ]
    if flights.running and flights.report is not None:
        flight = flights.report
        offset = "" if flight.last_offset is None else f", {flight.last_offset:.2f} m off"
        lines.append(f"{flight.verb}: {flights.phase}, attempt {flight.attempts}{offset}")
    return lines
