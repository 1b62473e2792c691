"""/audit: what was commanded, by whom, and what happened to the vehicles meanwhile."""

from __future__ import annotations

import re
from datetime import datetime, timezone
from typing import Annotated, Any, cast

from pydantic import AfterValidator, AwareDatetime, BeforeValidator, ConfigDict, Field, create_model, with_config
from typing_extensions import TypedDict

from mavproxy_uavapi.core.audit import COMMAND, KINDS, Entry
from mavproxy_uavapi.core.text import nearest
from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.contract.answers import means
from mavproxy_uavapi.http.contract.requests import HIGHEST_SYSTEM, Request, Written

MOST_ENTRIES = 1000  # of one answer


def _with_plus(value: Any) -> Any:
    """In a query a + that is not escaped is a space; before a time zone it was a +."""
    return re.sub(r" (\d\d:?\d\d)$", r"+\1", value) if isinstance(value, str) else value


def _kinds(text: str) -> str:
    for word in filter(None, text.split(",")):
        if word not in KINDS:
            raise ValueError(f"there is no kind {word!r:.40}; {nearest(word, KINDS)}")
    return text


Moment = Annotated[AwareDatetime | None, BeforeValidator(_with_plus)]


class AuditPage(Request):
    """Which entries: by time, vehicle and kind, the newest first, so many at a time."""

    to: Annotated[Moment, Field(description="as from; what happened then does not count")] = None
    vehicle: Annotated[
        int | None, Field(ge=1, le=HIGHEST_SYSTEM, description="system id; omitted for all"), Written
    ] = None
    kind: Annotated[
        str, AfterValidator(_kinds), Field(description=f"of {', '.join(KINDS)}; by comma; omitted for all")
    ] = ""
    limit: Annotated[int, Field(ge=1, le=MOST_ENTRIES, description="entries of one answer"), Written] = 100
    before: Annotated[str, Field(max_length=40, description="the `next` of an answer: what is older than that")] = ""


# A field of a class cannot have this name.
_FROM: dict[str, Any] = {
    "from": (Moment, Field(None, description="s since 1970, or ISO 8601 with a zone: 2026-05-04T13:20:07+02:00"))
}
AuditFilter: type[AuditPage] = create_model(
    "AuditFilter",
    __base__=AuditPage,
    __doc__=AuditPage.__doc__,
    **_FROM,
)


@with_config(ConfigDict(extra="allow"))
class EntryView(TypedDict):
    """A command or an event; a command also has what the trail has of it, an event what is known of it."""

    time: Annotated[str, means("UTC, ISO 8601", "2026-05-04T11:20:07.412+00:00")]
    kind: Annotated[str, means(f"one of {', '.join(KINDS)}", "mode")]
    vehicle: Annotated[int, means("system id; 0 for none", 1)]
    sentence: Annotated[str, means("what happened", "vehicle 1 changes from GUIDED to LAND, by a failsafe")]
    id: Annotated[str, means("names it", "20260504-112007-17")]


class Trail(TypedDict):
    """A page of the trail, the newest entry first."""

    entries: list[EntryView]
    next: Annotated[str | None, means("`before` for the following page; null where this is the last", None)]


async def show(call: Call) -> Trail:
    """The trail: commands and events, the newest first; `next` is for the following page."""
    page = call.params(AuditPage)
    system, kinds = page.vehicle or call.named_system, set(filter(None, page.kind.split(",")))

    def is_wanted(entry: Entry) -> bool:
        return system in (0, entry.system) and (not kinds or entry.kind in kinds)

    def may_be_wanted(line: str) -> bool:
        is_kind = not kinds or COMMAND in kinds or any(f'"kind": "{kind}"' in line for kind in kinds)
        return is_kind and (not system or f'"system": {system}' in line)

    entries = await call.service.host.audit.page(
        is_wanted,
        page.limit,
        since=_stamp(getattr(page, "from")),
        until=_stamp(page.to),
        before=page.before,
        hint=may_be_wanted,
    )
    following = entries[-1].id if len(entries) == page.limit else None
    return {"entries": [cast(EntryView, entry.report()) for entry in entries], "next": following or None}


def _stamp(moment: datetime | None) -> str:
    """A time as `Entry.time` has it; empty for none."""
    return "" if moment is None else moment.astimezone(timezone.utc).isoformat(timespec="milliseconds")
