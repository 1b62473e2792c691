"""The shapes of the answers of /vision."""

from __future__ import annotations

from typing import Annotated, Any

from typing_extensions import NotRequired, TypedDict

from mavproxy_uavapi.http.extension import Aged, Success, means


class Setpoints(TypedDict):
    """How long after the light of a frame its setpoint was sent."""

    median: Annotated[float, means("ms", 41.0)]
    p99: Annotated[float, means("ms", 63.0)]


class FlightReport(TypedDict):
    """How a flight went, as far as it is known."""

    verb: Annotated[str, means("land, search or mission", "land")]
    method: NotRequired[Annotated[str, means("velocity or landing_target", "velocity")]]
    tag: NotRequired[Annotated[int, means("its id", 4)]]
    attempts: Annotated[int, means("descents that were begun", 1)]
    duration: Annotated[float, means("s on the vehicle's clock", 21.4)]
    phases: Annotated[dict[str, float], means("s by phase", {"descending": 12.3})]
    last_offset: NotRequired[Annotated[float, means("m from the tag, when it was last seen", 0.03)]]
    touchdown_error: NotRequired[Annotated[float, means("m from the tag", 0.05)]]
    action: NotRequired[Annotated[str, means("what the vehicle does after a failure", "hold")]]
    reason: NotRequired[Annotated[str, means("why it failed", "the tag is lost")]]
    warning: NotRequired[Annotated[str, means("what a pilot should know", "no rangefinder")]]
    place: NotRequired[Annotated[list[float], means("of the tag, m north, east, down of the EKF origin", [1, 2, 0])]]
    track: NotRequired[Annotated[str, means("a file of this machine", "/home/pilot/landing.csv")]]
    plot: NotRequired[Annotated[str, means("a file of this machine", "/home/pilot/landing.svg")]]


class FlightView(FlightReport):
    """The flight that goes on, or the last one."""

    running: bool
    phase: Annotated[str | None, means("of a flight that goes on", "descending")]


class CameraStatus(TypedDict):
    """The camera, the tags and the flight."""

    source: Annotated[str | None, means("of the pictures, without a password", "usb:0")]
    camera: Annotated[str, means("how it is", "running")]
    error: Annotated[str | None, means("why it gives none", None)]
    rate: Annotated[float, means("frames per s", 20.0)]
    frames: Annotated[int, means("how many came", 812)]
    repeated: Annotated[int, means("how many were the same as before", 0)]
    skipped: Annotated[int, means("how many came while another was looked at", 3)]
    reconnects: int
    controls: Annotated[dict[str, Any], means("of the camera, by name", {})]
    families: Annotated[list[str], means("of the tags", ["36h11"])]
    tags: Annotated[
        list[dict[str, Any]], means("the tags that are looked for: id, size (m)", [{"id": 4, "size": 0.2}])
    ]
    in_view: Annotated[list[int], means("ids", [4])]
    frame_age_s: Annotated[float | None, means("s since its light", 0.06)]
    detector_ms: Annotated[float | None, means("ms that the newest frame took", 9.0)]
    setpoint_ms: NotRequired[Setpoints]
    flight: NotRequired[FlightView]


class CameraAnswer(Success):
    """The camera, the tags and the flight."""

    info: CameraStatus


class TagInView(TypedDict):
    """A tag as the camera sees it."""

    id: Annotated[int, means("of its family", 4)]
    family: Annotated[str, means("without its prefix", "36h11")]
    hamming: Annotated[int, means("wrong bits", 0)]
    corners: Annotated[list[list[float]], means("pixels", [[310, 230], [330, 230], [330, 250], [310, 250]])]
    size: Annotated[float | None, means("m", 0.2)]
    position: Annotated[list[float] | None, means("m right, down, ahead of the camera", [0.1, -0.2, 4.0])]
    distance: Annotated[float | None, means("m", 4.01)]
    rotation: Annotated[list[list[float]] | None, means("from the tag to the camera", None)]
    reprojection_error: Annotated[float | None, means("pixels", 0.12)]
    latency_s: Annotated[float, means("s from the light to the arrival", 0.04)]


class Tags(TypedDict):
    """The tags in a frame."""

    tags: list[TagInView]
    frame: Annotated[int, means("its number", 812)]


class TagsAnswer(Aged):
    """The tags in view."""

    info: Tags


class Flown(Success):
    """A flight that ended well."""

    info: FlightReport
