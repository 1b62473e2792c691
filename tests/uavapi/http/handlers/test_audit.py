from __future__ import annotations

from collections.abc import Callable
from typing import Any
from urllib.parse import quote

import pytest

from mavproxy_uavapi.core.audit import Entry, utc_at
from mavproxy_uavapi.core.host import Host
from tests.support.drone import Drone
from tests.uavapi.http.conftest import Api


@pytest.fixture
def trail(drone: Drone, host: Host, api: Api) -> Callable[..., Any]:
    """A trail of six entries, a minute after each other from 1000 s on; the page of a query."""
    host.audit.newest.clear()
    for number in range(6):
        kind = "mode" if number % 2 else "command"
        system = 1 if number < 4 else 2
        host.audit.add(
            Entry(utc_at(1000 + 60 * number), "anna", f"/{number}", {}, system, "ok", str(number), kind=kind)
        )
    return lambda query="": api.get(f"/audit?{query}")


def numbers(answer: Any) -> str:
    assert answer.status == 200, answer.body
    return "".join(
        entry["sentence"][0] if entry["kind"] == "mode" else entry["detail"] for entry in answer.body["entries"]
    )


@pytest.mark.parametrize(
    ("query", "expected"),
    [
        ("", "543210"),
        ("vehicle=1", "3210"),
        ("kind=mode", "531"),
        ("kind=mode,command&vehicle=2", "54"),
        ("from=1120", "5432"),
        ("to=1120", "10"),
        ("from=1060&to=1180", "21"),
        ("from=1970-01-01T00:18:40Z", "5432"),
        (f"from={quote('1970-01-01T01:18:40+01:00')}", "5432"),
        ("from=1970-01-01T01:18:40+01:00", "5432"),
        ("limit=2", "54"),
    ],
)
def test_page_has_what_is_asked_for_the_newest_first(trail: Callable[..., Any], query: str, expected: str) -> None:
    assert numbers(trail(query)) == expected


def test_pages_follow_each_other(trail: Callable[..., Any]) -> None:
    seen, following = "", ""
    while following is not None:
        answer = trail(f"limit=4&before={following}")
        seen += numbers(answer)
        following = answer.body["next"]
    assert seen == "543210"


@pytest.mark.parametrize(
    "query",
    [
        "kind=modes",
        "from=yesterday",
        "from=1970-01-01T01:18:40",
        "vehicle=0",
        "limit=0",
        "limit=1001",
        "since=5",
        "from=nan",
    ],
)
def test_what_means_nothing_is_refused(trail: Callable[..., Any], query: str) -> None:
    assert trail(query).status == 422


def test_page_after_an_entry_that_is_gone_is_not_found(trail: Callable[..., Any]) -> None:
    assert trail("before=1-1").status == 404


def test_path_of_a_vehicle_means_that_vehicle(
    trail: Callable[..., Any], api: Api, make_drone: Callable[..., Drone]
) -> None:
    make_drone(2)
    entries = api.get("/vehicles/2/audit").body["entries"]
    assert {entry["vehicle"] for entry in entries} == {2}


def test_command_has_its_client_and_an_event_only_what_is_its_own(drone: Drone, host: Host, api: Api) -> None:
    host.audit.newest.clear()
    api.get("/command/takeoff?alt=5")
    host.note("mode", 1, "vehicle 1 changes", to="LAND")
    event, command = api.get("/audit").body["entries"]
    assert set(event) == {"time", "kind", "vehicle", "sentence", "id", "to"}
    assert command["client"] == "127.0.0.1"
    assert command["sentence"].startswith(
        "vehicle 1: takeoff (alt 5) of 127.0.0.1 fails at once: the vehicle is not armed"
    )
