"""The camera, the tags in view and the flight, as JSON objects for /vision/status and /vision/tags. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from mavproxy_vision.apriltag.detection import FrameResult
from mavproxy_vision.landing.flight_jobs import FlightJobs
from mavproxy_vision.tracking.tracker import Tracker


def status(tracker: Tracker, flights: FlightJobs) -> dict[str, Any]:
    """The camera and the flight as a JSON object."""
    health, settings = tracker.health, tracker.settings
    result = tracker.fresh_result
    body: dict[str, Any] = {
        "source": settings.shown_source or None,
        "camera": health.state,
        "error": health.error or None,
        "rate": round(health.rate, 1),
        "frames": health.frames,
        "repeated": health.repeated,
        "skipped": health.skipped,
        "reconnects": health.reconnects,
        "controls": tracker.controls,
        "families": list(settings.families),
        "tags": [vars(tag) for tag in settings.tag_list],
        "in_view": [detection["id"] for detection in in_view(result)],
        "frame_age_s": None if result is None else round(tracker.host.clock() - result.captured_at, 3),
        "detector_ms": None if result is None else round(1000 * (result.done_at - result.received_at), 1),
    }
    if tracker.latencies:
        body["setpoint_ms"] = {
            "median": percentile(tracker.latencies, 0.5),
            "p99": percentile(tracker.latencies, 0.99),
        }
    if flights.report is not None:
        body["flight"] = {"running": flights.running, "phase": flights.phase, **flights.report.as_dict()}
    return body


def percentile(seconds: Iterable[float], share: float) -> float:
    """A percentile of times, in ms."""
    ordered = sorted(seconds)
    return round(1000 * ordered[min(int(share * len(ordered)), len(ordered) - 1)], 1)


def in_view(result: FrameResult | None) -> list[dict[str, Any]]:
    """The tags of a result, for an answer body."""
    return [] if result is None else [_tag_report(result, detection) for detection in result.detections]


def _tag_report(result: FrameResult, detection: Any) -> dict[str, Any]:
    has_position = detection.position is not None
    return {
        "id": detection.id,
        "family": detection.family,
        "hamming": detection.hamming,
        "corners": [[round(float(value), 2) for value in corner] for corner in detection.corners],
        "size": detection.size or None,
        "position": [round(float(value), 3) for value in detection.position] if has_position else None,
        "distance": round(detection.distance, 3) if has_position else None,
        "rotation": [[round(float(v), 4) for v in row] for row in detection.rotation] if has_position else None,
        "reprojection_error": round(detection.error, 3) if has_position else None,
        "latency_s": round(result.latency, 3),
    }
