"""The shapes of the answers of /gradys."""

from __future__ import annotations

from typing import Annotated, Any

from typing_extensions import TypedDict

from mavproxy_uavapi.http.extension import Success, means

Rows = list[dict[str, Any]]


class GradysStatus(TypedDict):
    """What became of positions and readings; docs/gradys.md explains each row."""

    running: bool
    sent: Annotated[int, means("positions", 812)]
    acknowledged: Annotated[int, means("positions that stations have taken", 812)]
    dropped_by_station: Annotated[int, means("positions that came too late to be sent", 0)]
    last_error: Annotated[str | None, means("a sentence", None)]
    round_trip_ms: Annotated[dict[str, Any] | None, means("ms of a position and its answer", None)]
    stations: Annotated[Rows, means("by address", [])]
    spooled: Annotated[int | None, means("readings that are kept here", 12)]
    oldest_unsent_s: Annotated[float | None, means("s since it was measured", 4.2)]
    spool: Annotated[dict[str, Any] | None, means("the file of the readings", None)]
    sinks: Annotated[Rows, means("where readings go", [])]
    quantities: Annotated[Rows, means("what is measured", [])]
    tracks: Annotated[Any, means("the track that is flown", None)]


class GradysAnswer(Success):
    """What became of positions and readings."""

    info: GradysStatus


class Kept(Success):
    """Readings that are on the disk."""

    seq: Annotated[list[int], means("their numbers", [4711])]


class Series(TypedDict):
    """The newest numbers of one device and quantity."""

    device: Annotated[str, means("its name", "uav-1")]
    quantity: Annotated[str, means("its name", "temperature")]
    representation: Annotated[str, means("unit, or empty", "degC")]
    points: Annotated[list[list[float]], means("s since 1970, and the value", [[1767323045.0, 21.5]])]


class Recent(Success):
    """The newest numbers."""

    series: list[Series]
