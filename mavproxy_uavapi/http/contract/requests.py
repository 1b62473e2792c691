"""Request models: one per set of parameters, for queries and JSON bodies.

A name that a model does not have is refused, and so are NaN and infinities: neither must ever reach an autopilot, nor
let a default fly instead. Names that the original service takes and does not use are known.
"""

from __future__ import annotations

import math
import re
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from mavproxy_uavapi.core.values import NUMBER

HIGHEST_SYSTEM = 255
SMALLEST = 1e-30  # more than single precision's least number
LONGEST_LEASE = 3600.0  # s
NED_REACH = 100_000.0  # m; beyond this the earth's curvature matters


def _written_as_number(value: Any) -> Any:
    """Refuse values that only Python reads as numbers: true, false and `1_000`."""
    if isinstance(value, bool) or (isinstance(value, str) and "_" in value):
        raise ValueError("Input should be a valid number")
    return value


def _not_nothing(value: float) -> float:
    """Refuse a value that is greater than 0 but becomes 0 in the single precision that the autopilot receives."""
    if value < SMALLEST:
        raise ValueError("Input should be greater than 0 in single precision")
    return value


def _nothing_if_zero(value: float) -> float:
    """As `_not_nothing`, but 0 itself is taken."""
    return value if value == 0 else _not_nothing(value)


def _number(value: Any) -> Any:
    """Keep the client's notation: `30` stays an int and `30.5` is a float, so that answers repeat it."""
    value = _written_as_number(value)
    if isinstance(value, str):
        try:
            return int(value)
        except ValueError:
            if not re.fullmatch(NUMBER, value.strip()):
                raise ValueError("Input should be a valid number") from None
            value = float(value)
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError("Input should be a finite number")
    if not isinstance(value, int | float):
        raise ValueError("Input should be a valid number")
    return value


Number = Annotated[int | float, BeforeValidator(_number)]
NotNothing = AfterValidator(_not_nothing)
Written = BeforeValidator(_written_as_number)
Speed = Annotated[Number, Field(ge=0, le=50, description="m/s", examples=[5]), AfterValidator(_nothing_if_zero)]
Timeout = Annotated[float | None, Field(gt=0, le=86400, description="s that the call may take"), Written]
Looking = Annotated[bool, Field(description="point in the direction of travel")]
Facing = Annotated[
    float | None,
    Field(ge=0, le=360, description="point there, degrees clockwise from north; it overrides look_at_target"),
    Written,
]
Duration = Annotated[float | None, Field(gt=0, le=3600, description="s, on the vehicle's clock"), Written]
Tolerance = Annotated[float, Field(gt=0, le=100, description="m, horizontally and vertically"), Written]
Argument = Annotated[str, Field(max_length=4096, pattern=r"^[^\x00]*$")]  # no command line can hold a 0


class Request(BaseModel):
    """Base of all request models."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


class Empty(Request):
    """No parameters."""


class CallOptions(Request):
    """What the query of any call may say besides its parameters."""

    client: Annotated[
        str | None,
        Field(pattern=r"^[A-Za-z0-9_.:-]{1,64}$", description="tells clients of one address apart, for leases"),
    ] = None


class JobOptions(CallOptions):
    """The same for a call that begins a job."""

    wait: Annotated[bool, Field(description="false: answer 202 at once with the job's number; the job goes on")] = (
        True
    )
    on_disconnect: Annotated[
        Literal["continue", "hold"] | None,
        Field(description="what the vehicle does when the client hangs up; it overrides the setting of that name"),
    ] = None
    lease: Annotated[
        float | None,
        Field(
            ge=0,
            le=LONGEST_LEASE,
            description="s without a call of this client until `on_lease_end` is done; 0 gives the lease back",
        ),
        Written,
    ] = None


class Blocking(Request):
    """A call that waits."""

    timeout: Timeout = None


class Disarm(Request):
    """`force` stops the motors even in flight."""

    force: Annotated[bool, Field(description="even in flight: the vehicle falls")] = False


class Takeoff(Blocking):
    """`alt`: m above home. A plane climbs with the pitch of its parameter TKOFF_LVL_PITCH."""

    alt: Annotated[Number, Field(gt=0, le=1000, description="m above home", examples=[10]), NotNothing] = 15
    vtol: Annotated[bool, Field(description="vertically (a QuadPlane)")] = False
    pitch_deg: Annotated[
        float | None,
        Field(ge=-90, le=90, exclude=True, description="degrees; not used: clients of the original service send it"),
        Written,
    ] = None


class LandAt(Request):
    """A landing place: degrees, and m above home; `vtol` lands vertically, if the plane can."""

    lat: Annotated[Number, Field(ge=-90, le=90, description="degrees", examples=[-35.3629])]
    long: Annotated[Number, Field(ge=-180, le=180, description="degrees", examples=[149.1652])]
    alt: Annotated[Number, Field(ge=-1000, le=10_000, description="m above home")] = 0
    vtol: Annotated[bool, Field(description="vertically (a QuadPlane)")] = False


class Reverse(Request):
    """`reverse`: true drives backwards, false forwards again."""

    reverse: Annotated[bool, Field(description="backwards", examples=[True])] = True


class ModeName(Request):
    """`mode`: a name of the vehicle's mode map."""

    mode: Annotated[
        str, Field(min_length=1, max_length=32, description="a mode's name, such as LOITER", examples=["LOITER"])
    ]


class NewSpeed(Request):
    """`new_v`: m/s; of 0 the autopilot decides what it means: a copter refuses it."""

    new_v: Speed


class SimFactor(Request):
    """`sim_factor`: simulated seconds per second."""

    sim_factor: Annotated[Number, Field(gt=0, le=1000, description="simulated s per s", examples=[5]), NotNothing]


class GpsPlace(Request):
    """A place: degrees, and m above home."""

    lat: Annotated[Number, Field(ge=-90, le=90, description="degrees", examples=[-35.3629])]
    long: Annotated[Number, Field(ge=-180, le=180, description="degrees", examples=[149.1652])]
    alt: Annotated[Number, Field(ge=-1000, le=10_000, description="m above home; negative: below it", examples=[20])]


class GpsTarget(GpsPlace, Blocking):
    """A place to go to."""

    look_at_target: Looking = False
    heading: Facing = None
    tolerance: Tolerance = 1.0


class NedPlace(Blocking):
    """North, east, down in m: from the EKF origin or from the present position, depending on the path."""

    x: Annotated[Number, Field(ge=-NED_REACH, le=NED_REACH, description="m north", examples=[20])]
    y: Annotated[Number, Field(ge=-NED_REACH, le=NED_REACH, description="m east", examples=[10])]
    z: Annotated[Number, Field(ge=-10_000, le=10_000, description="m down", examples=[-12])]
    look_at_target: Looking = False
    heading: Facing = None
    tolerance: Tolerance = 1.0


class BodyOffset(Blocking):
    """Front, right, down in m from the present position, in the body frame."""

    front: Annotated[Number, Field(ge=-NED_REACH, le=NED_REACH, description="m", examples=[5])]
    right: Annotated[Number, Field(ge=-NED_REACH, le=NED_REACH, description="m", examples=[0])]
    down: Annotated[Number, Field(ge=-10_000, le=10_000, description="m")] = 0
    look_at_target: Looking = False
    heading: Facing = None
    tolerance: Tolerance = 1.0


class NedVelocity(Request):
    """North, east, down in m/s; `duration` in s on the vehicle's clock."""

    vx: Annotated[Number, Field(ge=-50, le=50, description="m/s north", examples=[1])]
    vy: Annotated[Number, Field(ge=-50, le=50, description="m/s east", examples=[0])]
    vz: Annotated[Number, Field(ge=-50, le=50, description="m/s down", examples=[0])]
    look_at_target: Looking = False
    heading: Facing = None
    duration: Duration = None


class BodyVelocity(Request):
    """Front, right, down in m/s, by the heading at the start; `duration` in s on the vehicle's clock."""

    front: Annotated[Number, Field(ge=-50, le=50, description="m/s", examples=[1])]
    right: Annotated[Number, Field(ge=-50, le=50, description="m/s", examples=[0])]
    down: Annotated[Number, Field(ge=-50, le=50, description="m/s")] = 0
    look_at_target: Looking = False
    heading: Facing = None
    duration: Duration = None


class Heading(Request):
    """`heading`: degrees clockwise from north."""

    heading: Annotated[Number, Field(ge=0, le=360, description="degrees clockwise from north", examples=[90])]


class YawRate(Request):
    """`yaw_rate`: deg/s, clockwise positive."""

    yaw_rate: Annotated[Number, Field(ge=-360, le=360, description="deg/s, clockwise positive", examples=[10])]


class Servo(Request):
    """`channel` from 1, `pwm` in microseconds."""

    channel: Annotated[int, Field(ge=1, le=16, description="servo output, from 1", examples=[9]), Written]
    pwm: Annotated[int, Field(ge=800, le=2200, description="microseconds", examples=[1500]), Written]


class ScriptName(Request):
    """`script_name`: an uploaded script; `.py` may be left out."""

    script_name: Annotated[
        str, Field(min_length=1, max_length=200, description="`.py` may be left out", examples=["square.py"])
    ]


class ExecuteScript(ScriptName):
    """`args`: the script's command-line arguments."""

    args: Annotated[
        list[Argument], Field(max_length=100, description="its command-line arguments", examples=[["10"]])
    ] = []


class Rehearse(Request):
    """An uploaded script, or a request that flies a track or vision's mission; without both the vehicle's mission."""

    script_name: Annotated[str | None, Field(max_length=255, description="an uploaded script")] = None
    path: Annotated[
        str | None, Field(max_length=100, description="of the request", examples=["/mission/fly-track"])
    ] = None
    body: Annotated[dict[str, Any], Field(description="of the request", examples=[{"track": "…"}])] = {}
    args: Annotated[list[Argument], Field(max_length=100, description="the script's command-line arguments")] = []
    faults: Annotated[
        list[Annotated[str, Field(max_length=100)]],
        Field(max_length=10, description="what goes wrong, as of `run`", examples=[["link_loss@20s:10s"]]),
    ] = []
    seed: Annotated[int, Field(ge=0, le=2**31 - 1, description="of the vehicle's randomness")] = 0

    @model_validator(mode="after")
    def _one_file(self) -> Rehearse:
        if self.script_name is not None and self.path is not None:
            raise ValueError("give script_name or path")
        if (self.args and self.script_name is None) or (self.body and self.path is None):
            raise ValueError("args are a script's, body is that of a request to path")
        return self


class ShowRehearsals(Request):
    """`until_ended`: answer when the rehearsal under way has ended."""

    until_ended: Annotated[bool, Field(description="answer when the rehearsal under way has ended")] = False


class ScriptLog(Request):
    """`stream`: out or err. With `follow` both come line by line, as Server-Sent Events, until the run ends."""

    stream: Annotated[Literal["out", "err"], Field(description="which log, without follow")] = "out"
    follow: Annotated[bool, Field(description="as Server-Sent Events, until the run ends")] = False


class PutEnvelope(Request):
    """`preview`: read it and show it, but put nothing in force."""

    preview: Annotated[bool, Field(description="read it and show it, but put nothing in force")] = False


class UploadedFile(Request):
    """What the audit trail has of a file: its name, if it came with one, and the hash of its contents."""

    file: str | None = None
    sha256: str


class MissionFile(Request):
    """An uploaded mission: a QGC WPL 110 file, a .plan file, or JSON items."""

    digest: str  # identifies the upload
    items: int


class StartMission(Blocking):
    """`until_complete`: answer when the mission ends; otherwise when it begins."""

    until_complete: Annotated[bool, Field(description="answer when the mission ends")] = False


class Photo(Request):
    """A picture: the tool, pixels, ms before it, ms of exposure, and the focus distance in m."""

    command: Annotated[
        str, Field(description="fswebcam, rpicam-still, libcamera-still, or vision", examples=["rpicam-still"])
    ]
    resolution: Annotated[str, Field(description="width x height in pixels")] = "1280x720"
    capture_time: Annotated[float, Field(ge=0, le=10_000, description="ms to settle before it"), Written] = 150
    focus_distance: Annotated[float | None, Field(ge=0.01, le=1000, description="m"), Written] = None
    exposure: Annotated[
        float | None, Field(gt=0, le=10_000, description="ms of a Raspberry Pi's camera; none: its own"), Written
    ] = None


class Read(Request):
    """A telemetry read: `max_age` is the highest acceptable age (s) of the data."""

    max_age: Annotated[float | None, Field(gt=0, le=86400, description="highest acceptable age in s"), Written] = None


def list_of_systems(text: str) -> str:
    """The text, if it is a list of system ids by comma, or empty.

    Raises:
        ValueError: it is none.
    """
    words = [word.strip() for word in text.split(",")] if text else []
    if not all(re.fullmatch(r"[0-9]{1,3}", word) and 1 <= int(word) <= HIGHEST_SYSTEM for word in words):
        raise ValueError(f"Input should be system ids of 1 to {HIGHEST_SYSTEM} by comma")
    return ",".join(words)


class StreamFilter(Request):
    """What a stream tells: names by comma, with `*` and `?`.

    With none of `names`, `view` and `events` it tells all messages.
    """

    names: Annotated[str, Field(description="messages, such as ATTITUDE,GPS*", examples=["ATTITUDE,GPS_RAW_INT"])] = (
        ""
    )
    view: Annotated[str, Field(description="payloads of this API, such as gps,attitude,status")] = ""
    events: Annotated[str, Field(description="mode, armed, job …; * for all")] = ""
    sysid: Annotated[int | None, Field(ge=1, le=255, description="system id; omitted for all"), Written] = None
    vehicles: Annotated[
        str, AfterValidator(list_of_systems), Field(description="system ids by comma, such as 1,2; omitted for all")
    ] = ""
    rate: Annotated[
        float | None, Field(gt=0, le=1000, description="Hz of each name; the newest is kept", examples=[2]), Written
    ] = None

    @property
    def systems(self) -> frozenset[int]:
        """The system ids of `vehicles` and `sysid`; empty for all."""
        listed = {int(word) for word in self.vehicles.split(",") if word}
        return frozenset(listed | ({self.sysid} if self.sysid else set()))
