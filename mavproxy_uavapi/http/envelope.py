"""/envelope: where vehicles may fly; all of them, or with the prefix /vehicles/{sysid} one."""

from __future__ import annotations

import asyncio
import hashlib
from typing import Any

from mavproxy_uavapi.core.airspace import formats
from mavproxy_uavapi.core.airspace.space import Space
from mavproxy_uavapi.core.airspace.store import ALL, API, Key
from mavproxy_uavapi.core.errors import NotFound
from mavproxy_uavapi.http.access import require_owner
from mavproxy_uavapi.http.bodies import in_time
from mavproxy_uavapi.http.call import Call
from mavproxy_uavapi.http.requests import PutEnvelope, UploadedFile
from mavproxy_uavapi.http.responses import Answer, envelope
from mavproxy_uavapi.http.route import ANY_FILE, JSON

XML = ("application/vnd.google-earth.kml+xml", "application/vnd.google-earth.kmz", "application/xml", "text/xml")
FILE = ("application/geo+json", JSON, *XML, "text/plain", *ANY_FILE)


async def show(call: Call) -> Answer:
    """The envelopes in force: all, or those of one vehicle; it must be inside every one of them."""
    envelopes = call.service.host.envelopes
    mine = (ALL, call.named_system) if call.named_system else None
    shown = [_report(key, space) for key, space in envelopes.all() if mine is None or key.system in mine]
    return _answer(call, "Success", envelopes=shown)


async def put(call: Call) -> Answer:
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
    counts = {"inclusions": written.inclusions, "exclusions": written.exclusions, "remarks": list(written.remarks)}
    shown = {"envelope": formats.geojson(written)} if preview else {}
    begin = "Envelope read, not in force" if preview else "Envelope in force"
    return _answer(call, f"{begin}: {written.summary()}", **counts, **shown)


async def remove(call: Call) -> Answer:
    """Take away the envelope that came by this path; what the operator has set stays in force."""
    require_owner(call, "who may set an envelope")
    envelopes, key = call.service.host.envelopes, Key(API, call.named_system or ALL)
    if key not in dict(envelopes.all()):
        raise NotFound("no envelope came by this path; what `uavapi set envelope` has set stays in force")
    envelopes.put(*key, None)
    return _answer(call, "Envelope removed")


def _answer(call: Call, result: str, **members: Any) -> dict[str, Any]:
    system = call.named_system or call.service.host.registry.resolve(call.system)
    return envelope(system, result, **members)


def _report(key: Key, space: Space) -> dict[str, Any]:
    return {
        "by": key.by,
        "vehicle": key.system or None,
        "source": space.envelope.source,
        "missing": space.missing or None,
        "every": space.envelope.every,
        "envelope": None if space.missing else formats.geojson(space.envelope),
    }
