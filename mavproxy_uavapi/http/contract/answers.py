"""The shapes of answers, from which the description is made. An action's return type says which is its.

Members may be added within a version; none is taken away, and none changes its meaning or its unit.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Generic, Literal, TypeVar

from pydantic import Field
from typing_extensions import NotRequired, TypedDict

T = TypeVar("T")


def means(text: str, example: Any) -> Any:
    """What a member is, with its unit, and an example for the documentation."""
    return Field(description=text, examples=[example])


Degrees = Annotated[float, means("degrees", 90.1)]
Latitude = Annotated[float, means("degrees", -35.363)]
Longitude = Annotated[float, means("degrees", 149.1653)]
Age = Annotated[float, means("s since it arrived", 0.12)]
System = Annotated[int, means("system id", 1)]
Pilot = Annotated[str, means("the name of a token, or an address", "anna")]
Moment = Annotated[str, means("ISO 8601", "2026-01-02T03:04:05+00:00")]
GeoJSON = Annotated[
    dict[str, Any],
    means("GeoJSON: a FeatureCollection of areas", {"type": "FeatureCollection", "features": [], "limits": {}}),
]


class Success(TypedDict):
    """A success."""

    device: Literal["uav"]
    id: Annotated[str | None, means("the vehicle's system id; null if there is none", "1")]
    result: Annotated[str, means("a sentence", "success")]


class Aged(Success):
    """A success that shows what the vehicle has reported."""

    age_s: Age


class Info(Aged, Generic[T]):
    """What the vehicle has reported."""

    info: T


class Accepted(Success):
    """It goes on as a job."""

    job: Annotated[str, means("of /jobs/{id}", "12")]


class PositionView(TypedDict):
    """A place."""

    lat: Latitude
    lon: Longitude
    alt: Annotated[float, means("m above mean sea level", 604.2)]


class GlobalPositionView(PositionView):
    """A place of a vehicle."""

    relative_alt: Annotated[float, means("m above home", 20.0)]


class VelocityView(TypedDict):
    """A velocity by the compass."""

    vx: Annotated[float | None, means("m/s north", 4.9)]
    vy: Annotated[float | None, means("m/s east", 0.1)]
    vz: Annotated[float | None, means("m/s down", 0.0)]


class LinkView(TypedDict):
    """How the vehicle is heard."""

    alive: bool
    heartbeat_age_s: Annotated[float, means("s since its last heartbeat", 0.4)]
    packet_loss: Annotated[float, means("share of its messages that did not arrive, 0 to 1", 0.0)]


class ConditionView(TypedDict):
    """Whether a vehicle is ready to fly."""

    mode: Annotated[str, means("of its type", "GUIDED")]
    armed: bool
    landed_state: Annotated[
        Literal["on_ground", "in_air", "takeoff", "landing", "unknown"], means("MAV_LANDED_STATE", "in_air")
    ]
    link: LinkView
    ekf_ok: Annotated[bool, means("whether it has a position estimate", True)]
    gps_fix: Annotated[int | None, means("GPS_FIX_TYPE", 6)]
    battery_remaining: Annotated[int | None, means("%", 87)]
    ready_to_arm: bool
    why_not: Annotated[list[str], means("what keeps it from being armed", [])]


class StatusView(ConditionView):
    """Whether a vehicle is ready to fly, and its type."""

    vehicle_type: Annotated[str, means("copter, plane, rover or boat", "copter")]


class CommanderView(TypedDict):
    """The job that flies a vehicle."""

    job: Annotated[str, means("of /jobs/{id}", "7")]
    verb: Annotated[str, means("its path", "/movement/go_to_ned_wait")]
    client: Annotated[str, means("who began it", "127.0.0.1")]


class LeaseView(TypedDict):
    """Under whose lease a vehicle is."""

    client: str
    remaining_s: Annotated[float | None, means("s until it ends", 12.5)]


class VehicleView(ConditionView):
    """A vehicle that was heard."""

    id: System
    type: Annotated[str, means("copter, plane, rover or boat", "copter")]
    position: GlobalPositionView | None
    velocity: VelocityView | None
    heading: Degrees | None
    age_s: Annotated[float | None, means("s since its position arrived", 0.12)]
    current: Annotated[bool, means("whether paths without a vehicle mean it", True)]
    paused: Annotated[bool, means("whether `stop` holds it", False)]
    commanded_by: CommanderView | None
    held_by: Pilot | None
    lease: LeaseView | None


class VehiclesView(TypedDict):
    """Every vehicle that was heard."""

    vehicles: list[VehicleView]


class HoldView(TypedDict):
    """Who holds a vehicle, and who commands it."""

    vehicle: System
    held_by: Pilot | None
    role: Annotated[str | None, means("watch, fly or admin", "fly")]
    remaining_s: Annotated[float | None, means("s until the hold ends", 30.0)]
    commanded_by: CommanderView | None


class Place(TypedDict):
    """Where it would happen."""

    lat: Latitude
    long: Longitude
    alt: NotRequired[Annotated[float, means("m above home", 12.0)]]


class Outside(TypedDict):
    """What an envelope or a limit forbids."""

    what: Annotated[str, means("what it would break", "ceiling of field")]
    at: NotRequired[Place]
    by: NotRequired[Annotated[float | None, means("by how much, in m, m/s or %; null where that has no end", 5.0)]]
    source: NotRequired[Annotated[str, means("where the limit comes from", "the envelope of 127.0.0.1")]]
    item: NotRequired[Annotated[int, means("number of a mission's item", 2)]]
    command: NotRequired[Annotated[int, means("MAV_CMD of that item", 16)]]


class Near(TypedDict):
    """The vehicle that it would come too near to."""

    vehicle: System
    in_s: Annotated[float, means("s until then", 4.2)]
    at: NotRequired[Place]


class Problem(TypedDict):
    """A value that is refused."""

    loc: Annotated[list[str | int], means("the path to it, from query or body on", ["body", "alt"])]
    msg: Annotated[str, means("a sentence", "Input should be less than or equal to 500, not 900")]
    type: Annotated[str, means("a word for programs", "less_than_equal")]


Change = TypedDict(  # in this form, because one member is called `from`
    "Change",
    {
        "what": Annotated[str, means("mode, armed or boot", "mode")],
        "from": Annotated[str, means("what was before", "GUIDED")],
        "to": Annotated[str, means("what is now", "LAND")],
        "time": Annotated[str, means("UTC, ISO 8601", "2026-05-04T11:20:07.412+00:00")],
        "mode": Annotated[str, means("of the vehicle", "LAND")],
        "by": Annotated[str, means("whose deed it was", "failsafe")],
        "last_sent": Annotated[Any, means("what was last sent to the vehicle, and by whom; null for nothing", None)],
        "in_the_air": NotRequired[bool],
    },
)


class Failure(TypedDict):
    """A failure: a sentence for the pilot, and a code for programs."""

    detail: str | list[Problem]
    code: Annotated[str, means("which failure it is", "busy")]  # the description names all of them
    ack: NotRequired[Annotated[str, means("MAV_RESULT or MAV_MISSION_RESULT, if the autopilot refused", "FAILED")]]
    statustext: NotRequired[Annotated[list[str], means("what the autopilot has said since", ["PreArm: GPS"])]]
    change: NotRequired[Change]
    outside: NotRequired[Outside]
    near: NotRequired[Near]
    stderr: NotRequired[Annotated[str, means("what the program that failed has said", "no server running")]]
    info: NotRequired[Annotated[dict[str, Any], means("how far the flight had come", {})]]


class JobFailure(Failure):
    """How a job failed, as the call that waits for it is answered."""

    status: Annotated[int, means("HTTP status", 409)]


class JobView(TypedDict):
    """A verb that runs, or has ended."""

    job: Annotated[str, means("its number", "7")]
    verb: Annotated[str, means("its path", "/movement/go_to_ned_wait")]
    request: Annotated[Mapping[str, Any], means("its parameters", {"x": 20, "y": 10, "z": -12})]
    client: Annotated[str, means("who began it", "127.0.0.1")]
    state: Annotated[Literal["running", "succeeded", "failed"], means("running, succeeded or failed", "running")]
    progress: Annotated[dict[str, Any], means("as the verb tells it; m", {"altitude": 12.0, "distance_to_go": 7.4})]
    seconds: Annotated[float, means("s since it began, or that it took", 3.2)]
    result: str | None
    error: JobFailure | None


class JobsView(TypedDict):
    """The running jobs, and the last ones that ended."""

    jobs: list[JobView]


class AbortedJob(JobView):
    """A job that was ended, and what the vehicle does then."""

    then: Annotated[str, means("what follows", "nothing is sent")]
