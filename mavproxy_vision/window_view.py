"""What `vision` shows on MAVProxy's map: where the tags lie that it has seen."""

from __future__ import annotations

from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_uavapi.core.geodesy import moved
from mavproxy_uavapi.core.windows import Place, View
from mavproxy_vision.tracking.tag_watch import place_of
from mavproxy_vision.tracking.tracker import Tracker


class TagView:
    """Keeps the last place of each tag, until the camera is closed.

    Args:
        tracker: has the newest detections.
    """

    def __init__(self, tracker: Tracker) -> None:
        self._tracker = tracker
        self._places: dict[str, Place] = {}

    def __call__(self) -> View:
        """The view; the asyncio thread only."""
        if self._tracker.worker is None:
            self._places = {}
        result = self._tracker.fresh_result
        if result is not None:
            at = self._tracker.carrier.clock.vehicle(result.captured_at)
            for detection in result.detections:
                ned = place_of(detection, self._tracker.settings.camera_mount, self._tracker.carrier.history, at)
                place = None if ned is None else self._on_earth(*ned[:2])
                if place is not None:
                    self._places[f"tag {detection.id}"] = place
        return View(places=dict(self._places))

    def _on_earth(self, north: float, east: float) -> Place | None:
        """Latitude and longitude of m from the EKF origin; None while the vehicle does not report its position."""
        try:
            vehicle = self._tracker.carrier.vehicle()
            here, local = vehicle.position(), vehicle.local_position()
        except UavApiError:
            return None
        return moved(*here.place, north - local.north, east - local.east)
