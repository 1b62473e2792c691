"""/rehearsals: a script, a request or the vehicle's mission is flown on an embedded vehicle first."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from functools import partial
from typing import Annotated, Any, cast

from typing_extensions import NotRequired, TypedDict

from mavproxy_uavapi.core.errors import Forbidden, NotFound, NoVehicle
from mavproxy_uavapi.core.mainloop.permit import no_check
from mavproxy_uavapi.core.mission.mission_watch import wpl
from mavproxy_uavapi.core.roles import Role
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from mavproxy_uavapi.files import rehearsals
from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.contract.answers import Latitude, Longitude, Success, means
from mavproxy_uavapi.http.contract.parsing import parse
from mavproxy_uavapi.http.contract.requests import Rehearse, ShowRehearsals
from mavproxy_uavapi.http.door.access import require_owner
from mavproxy_uavapi.scripts.rehearser import File, RehearsalReport

VERDICTS = {0: "well", 1: "failed", 2: "broken"}  # by the exit status of `mavproxy-uavapi run`
PRINTED = 4000  # characters
LAT, LON, HEIGHT, BATTERY = 1, 2, 3, 9  # columns of a report's samples


class BrokenRule(TypedDict):
    """A rule that was broken."""

    rule: Annotated[str, means("its name", "envelope")]
    at: Annotated[float, means("s of the vehicle's clock", 41.5)]
    sentence: Annotated[str, means("what happened", "it was 3.2 m inside mast")]


class LostThere(TypedDict):
    """Where the vehicle would end if something were lost for good at a moment of the flight."""

    at: Annotated[float, means("s of the vehicle's clock", 41.5)]
    what: Annotated[str, means("link, or companion with it; or gps", "link")]
    lat: Latitude
    lon: Longitude
    height: Annotated[float, means("m above home", 10.0)]
    mode: Annotated[str, means("that it ends in", "RTL")]
    armed: Annotated[bool, means("whether it stays up there", False)]
    seconds: Annotated[float, means("s until then", 35.0)]


class Verdict(TypedDict):
    """What came of a rehearsal. What was not flown has a failure only."""

    name: Annotated[str, means("of the script; mission.waypoints for the mission", "square.py")]
    verdict: Annotated[str, means("well, failed (the script), broken (a rule), or not flown", "broken")]
    failure: Annotated[str, means("why it failed, or was not flown", "")]
    broken: NotRequired[list[BrokenRule]]
    duration_s: NotRequired[Annotated[float, means("s of the vehicle's clock", 95.0)]]
    distance_m: NotRequired[Annotated[float, means("m, its way", 410.0)]]
    highest_m: NotRequired[Annotated[float, means("m above home", 25.0)]]
    battery_left: NotRequired[Annotated[float | None, means("percent at the end; null without a battery", 81.0)]]
    way: NotRequired[Annotated[list[list[float]], means("latitude, longitude, m above home", [[-35.36, 149.16, 10]])]]
    losses: NotRequired[list[LostThere]]
    output: NotRequired[Annotated[str, means("the end of what the script printed; for admins", "landed\n")]]


class Rehearsals(Success):
    """The rehearsal under way, and what came of the one before."""

    under_way: Annotated[str, means("the name of what is rehearsed now; empty for none", "")]
    newest: Verdict | None


async def rehearse(call: Call) -> Rehearsals:
    """Begin to fly a script, a request or the vehicle's mission on an embedded vehicle that is as the real one is.

    Nothing is commanded. One goes on at a time. `GET /rehearsals?until_ended=true` tells what came of it.
    """
    p, vehicle = call.params(Rehearse), call.known_vehicle
    call.require_right(vehicle.state.system)
    if p.path is not None:
        file = _request(call, p.path, p.body)
    elif p.script_name is None:
        name, content, digest = await _mission(vehicle)
        file = File(name, content, digest, ())
    else:
        require_owner(call, "scripts run on this machine")
        if call.caller.role < Role.ADMIN:
            raise Forbidden("scripts need the role admin; the vehicle's mission does not")
        path = await asyncio.to_thread(call.service.scripts.store.find, p.script_name)
        name, content = path.name, await asyncio.to_thread(path.read_bytes)
        file = File(name, content, rehearsals.digest_of(content), tuple(p.args))
    options = [f"--seed={p.seed}", *(f"--fault={fault}" for fault in p.faults)]
    call.service.rehearser.begin(vehicle, file, options)
    return _answer(call)


async def show(call: Call) -> Rehearsals:
    """The rehearsal under way, and what came of the one before; with `until_ended` once it has ended."""
    if call.params(ShowRehearsals).until_ended:
        await call.service.rehearser.ended()
    return _answer(call)


async def end(call: Call) -> Rehearsals:
    """End the rehearsal under way; nothing comes of it."""
    call.require_right(call.known_vehicle.state.system)
    await call.service.rehearser.end()
    return _answer(call)


def _answer(call: Call) -> Rehearsals:
    rehearser = call.service.rehearser
    newest = None if rehearser.newest is None else _verdict(rehearser.newest, call.caller.role)
    return {**call.answer("success"), "under_way": rehearser.under_way, "newest": newest}


async def require_rehearsed_script(call: Call, name: str, args: Sequence[str]) -> bytes | None:
    """Raise NotRehearsed, or warn at the prompt, unless a script was rehearsed well: the setting `rehearse`.

    Returns:
        The bytes that were rehearsed, where only they may run.
    """
    rehearse = call.service.settings.rehearse
    if rehearse == "off":
        return None
    path = await asyncio.to_thread(call.service.scripts.store.find, name)
    content = await asyncio.to_thread(path.read_bytes)
    try:
        vehicle = call.known_vehicle
    except NoVehicle:
        vehicle = None
    digest = rehearsals.digest_of(content)
    await asyncio.to_thread(call.service.rehearser.require, vehicle, path.name, digest, args)
    return content if rehearse == "require" else None


async def require_rehearsed_mission(call: Call, vehicle: Vehicle) -> Callable[[], None]:
    """Likewise the mission that the vehicle holds; what is returned raises Superseded once we have changed it."""
    if call.service.settings.rehearse == "off":
        return no_check
    changes = vehicle.waypoints.changes
    _, _, digest = await _mission(vehicle)
    await asyncio.to_thread(call.service.rehearser.require, vehicle, "the vehicle's mission", digest)
    return partial(vehicle.waypoints.require_unchanged, changes)


def _request(call: Call, path: str, body: dict[str, Any]) -> File:
    """A request to another path as a file.

    Raises:
        NotFound: the path flies nothing that is rehearsed, or its module is not loaded.
        Invalid: the body is none of it.
    """
    route = call.service.host.extensions.get(path)
    if route is None or route.conditions is None:
        rehearsed = [one.path for one in call.service.host.extensions.values() if one.conditions is not None]
        raise NotFound(f"{path} is not rehearsed; {', '.join(sorted(rehearsed)) or 'no loaded module has what'} is")
    return File.of_request(path, parse(route.model, "body", body).model_dump(), route.conditions())


async def _mission(vehicle: Vehicle) -> tuple[str, bytes, str]:
    """The mission that the vehicle holds: a name, a file with it, its digest."""
    home, items = await vehicle.waypoints.read()
    if not items:
        raise NotFound(f"vehicle {vehicle.state.system} holds no mission")
    text = await asyncio.to_thread(wpl, [home or items[0], *items])
    return "mission.waypoints", text.encode(), rehearsals.digest_of_mission(items)


def _verdict(outcome: RehearsalReport, role: Role) -> Verdict:
    if outcome.report is None:
        return {"name": outcome.name, "verdict": "not flown", "failure": outcome.failure}
    flight = outcome.report["flights"][0]
    (vehicle,) = flight["vehicles"].values()
    samples = vehicle["samples"]
    losses = [{name: one[name] for name in LostThere.__annotations__} for one in flight.get("losses", ())]
    return {
        "name": outcome.name,
        "verdict": VERDICTS[outcome.report["status"]],
        "failure": flight["failure"],
        "broken": [{"rule": one["rule"], "at": one["at"], "sentence": one["sentence"]} for one in flight["broken"]],
        "duration_s": flight["duration_s"],
        "distance_m": vehicle["distance_m"],
        "highest_m": vehicle["highest_m"],
        "battery_left": samples[-1][BATTERY] if samples else None,
        "way": [[sample[LAT], sample[LON], sample[HEIGHT]] for sample in samples],
        "losses": cast(list[LostThere], losses),
        **({"output": flight["output"][-PRINTED:]} if role >= Role.ADMIN else {}),  # type: ignore[typeddict-item]
    }
