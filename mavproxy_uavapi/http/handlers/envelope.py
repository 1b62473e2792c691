"""/envelope: where vehicles may fly; all of them, or with the prefix /vehicles/{sysid} one."""

from __future__ import annotations

import asyncio
import hashlib
from typing import Annotated

from typing_extensions import TypedDict

from mavproxy_uavapi.core.airspace import formats
from mavproxy_uavapi.core.airspace.space import Space
from mavproxy_uavapi.core.airspace.store import ALL, API, Key
from mavproxy_uavapi.core.errors import NotFound
from mavproxy_uavapi.core.link.messages import GlobalTarget
from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.contract.answers import GeoJSON, Success, means
from mavproxy_uavapi.http.contract.requests import GpsPlace, PutEnvelope, UploadedFile
from mavproxy_uavapi.http.contract.responses import envelope
from mavproxy_uavapi.http.contract.route import ANY_FILE, AREAS, JSON, OBJECT, TEXT
from mavproxy_uavapi.http.door.access import require_owner
from mavproxy_uavapi.http.wire.bodies import in_time

XML = ("application/vnd.google-earth.kml+xml", "application/vnd.google-earth.kmz", "application/xml", "text/xml")
FILE = {
    "application/geo+json": {**OBJECT, "example": AREAS},
    JSON: OBJECT,
    **dict.fromkeys((*XML, "text/plain"), TEXT),
    **ANY_FILE,
}


class EnvelopeInForce(TypedDict):
    """An envelope in force."""

    by: Annotated[str, means("who has set it", "api")]
    vehicle: Annotated[int | None, means("system id; null for all", None)]
    source: Annotated[str, means("where it comes from", "the envelope of 127.0.0.1")]
    missing: Annotated[str | None, means("why it cannot be read; nothing may be flown then", None)]
    every: Annotated[bool, means("whether a vehicle must be inside every inclusion", False)]
    envelope: GeoJSON | None


class EnvelopesView(Success):
    """The envelopes in force."""

    envelopes: list[EnvelopeInForce]


class EnvelopeRead(Success):
    """What an envelope says."""

    inclusions: Annotated[int, means("areas to stay in", 1)]
    exclusions: Annotated[int, means("areas to stay out of", 1)]
    remarks: Annotated[list[str], means("what a pilot should know of it", [])]


class EnvelopeShown(EnvelopeRead):
    """What an envelope says that is not in force."""

    envelope: GeoJSON


async def show(call: Call) -> EnvelopesView:
    """The envelopes in force: all, or those of one vehicle; it must be inside every one of them."""
    envelopes = call.service.host.envelopes
    mine = (ALL, call.named_system) if call.named_system else None
    shown = [_report(key, space) for key, space in envelopes.all() if mine is None or key.system in mine]
    return {**_answer(call, "success"), "envelopes": shown}


async def check(call: Call) -> Success:
    """Whether `/movement/go_to_gps` to that place would be refused now (the airspace, a holder); nothing moves."""
    vehicle, p = call.vehicle, call.params(GpsPlace)
    call.require_unheld(vehicle)
    await vehicle.know_for_airspace()
    vehicle.inside(GlobalTarget(p.lat, p.long, p.alt))()
    return call.answer("Allowed")


async def put(call: Call) -> EnvelopeRead | EnvelopeShown:
    """Put an envelope in force, for all vehicles or one, in place of the one that came by this path before.

    The body is a GeoJSON FeatureCollection, a KML, a KMZ, a .plan or a fence file. What the operator has set stays in
    force, too. With `preview` it is read and shown, and nothing is put in force.
    """
    require_owner(call, "who may set an envelope")
    preview = call.params(PutEnvelope).preview
    body = await in_time(call.request.read())
    call.remembered = UploadedFile(sha256=hashlib.sha256(body).hexdigest())
    source = f"the envelope of {call.client}"
    space = await asyncio.to_thread(lambda: Space(formats.of_bytes(body, source)))
    written = space.envelope
    if not preview:
        call.service.host.envelopes.put(API, call.named_system or ALL, space)
    begin = "Envelope read, not in force" if preview else "Envelope in force"
    answer: EnvelopeRead = {
        **_answer(call, f"{begin}: {written.summary()}"),
        "inclusions": written.inclusions,
        "exclusions": written.exclusions,
        "remarks": list(written.remarks),
    }
    return {**answer, "envelope": formats.geojson(written)} if preview else answer


async def remove(call: Call) -> Success:
    """Take away the envelope that came by this path; what the operator has set stays in force."""
    require_owner(call, "who may set an envelope")
    envelopes, key = call.service.host.envelopes, Key(API, call.named_system or ALL)
    if key not in dict(envelopes.all()):
        raise NotFound("no envelope came by this path; what `uavapi set envelope` has set stays in force")
    envelopes.put(*key, None)
    return _answer(call, "Envelope removed")


def _answer(call: Call, result: str) -> Success:
    system = call.named_system or call.service.host.registry.resolve(call.system)
    return envelope(system, result)


def _report(key: Key, space: Space) -> EnvelopeInForce:
    return {
        "by": key.by,
        "vehicle": key.system or None,
        "source": space.envelope.source,
        "missing": space.missing or None,
        "every": space.envelope.every,
        "envelope": None if space.missing else formats.geojson(space.envelope),
    }
