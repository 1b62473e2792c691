"""What is asked for when a track is to be flown: by whom it is read, and how it is remembered."""

from __future__ import annotations

import hashlib
from typing import Annotated

from pydantic import Field

from mavproxy_gradys.tracks.flight import HIGHEST_TAKEOFF, LARGEST_REACH, LOWEST_TRANSIT, REACH, TRANSIT
from mavproxy_gradys.tracks.formats import GROUND
from mavproxy_uavapi.http.extension import Request


class TrackLimits(Request):
    """How a track is to be flown.

    `ground` is the AMSL altitude (m) that heights count from, by default the track's lowest; every waypoint must
    lie within `reach` m of here; a first one that is not near is approached at `transit` m above home or higher.
    """

    ground: Annotated[float | None, Field(ge=GROUND[0], le=GROUND[1], description="m AMSL")] = None
    reach: Annotated[float, Field(gt=0, le=LARGEST_REACH, description="m")] = REACH
    transit: Annotated[float, Field(ge=LOWEST_TRANSIT, le=HIGHEST_TAKEOFF, description="m above home")] = TRANSIT


class TrackRequest(TrackLimits):
    """A track to fly: its text, in either of CentMesh's formats."""

    track: Annotated[str, Field(min_length=1)]


class TrackFile(TrackLimits):
    """What is remembered of a track that was to be flown: enough to tell one from another."""

    digest: str
    size: int

    @classmethod
    def of(cls, given: TrackRequest) -> TrackFile:
        """What stands for `given`."""
        data = given.track.encode("utf-8", "surrogatepass")
        limits = given.model_dump(exclude={"track"})
        return cls(digest=hashlib.sha256(data).hexdigest(), size=len(data), **limits)
