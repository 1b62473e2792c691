"""The request to fly a track, and its short form for the job list and the audit trail."""

from __future__ import annotations

import hashlib
from typing import Annotated

from pydantic import Field

from mavproxy_gradys.tracks.flight import HIGHEST_TAKEOFF, LARGEST_REACH, LOWEST_TRANSIT, REACH, TRANSIT
from mavproxy_gradys.tracks.formats import GROUND
from mavproxy_uavapi.http.extension import Request


class TrackLimits(Request):
    """How to fly a track.

    `ground` is the altitude (m AMSL) from which heights count, by default the track's lowest. Every waypoint must be
    within `reach` m of the vehicle. A first waypoint that is not near is approached `transit` m above home or higher.
    """

    ground: Annotated[float | None, Field(ge=GROUND[0], le=GROUND[1], description="m AMSL")] = None
    reach: Annotated[float, Field(gt=0, le=LARGEST_REACH, description="m")] = REACH
    transit: Annotated[float, Field(ge=LOWEST_TRANSIT, le=HIGHEST_TAKEOFF, description="m above home")] = TRANSIT


class TrackRequest(TrackLimits):
    """A track to fly: its text, in either of CentMesh's formats."""

    track: Annotated[str, Field(min_length=1)]


class TrackFile(TrackLimits):
    """The short form of a request: a digest identifies the track."""

    digest: str
    size: int

    @classmethod
    def of(cls, request: TrackRequest) -> TrackFile:
        """The short form of `request`."""
        data = request.track.encode("utf-8", "surrogatepass")
        limits = request.model_dump(exclude={"track"})
        return cls(digest=hashlib.sha256(data).hexdigest(), size=len(data), **limits)
