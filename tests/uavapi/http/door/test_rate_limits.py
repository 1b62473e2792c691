from __future__ import annotations

from dataclasses import replace

import pytest

from mavproxy_uavapi.http.callers.bucket import BURST, CLIENTS_KEPT, Bucket
from mavproxy_uavapi.http.callers.call import Service
from mavproxy_uavapi.http.door.rate_limits import REFUSAL_DELAY
from mavproxy_uavapi.rehearsal.virtual_time import AtOnce
from mavproxy_uavapi.settings import ApiModuleSettings
from tests.support.api_port import OWNER, Port
from tests.support.drone import Drone
from tests.support.virtual_time import FastLoop
from tests.uavapi.http.conftest import Api


def test_bucket_gives_a_burst_then_the_rate() -> None:
    bucket = Bucket()
    assert [bucket.take("a", 10, 0.0) for _ in range(int(10 * BURST))] == [0.0] * 20
    assert bucket.take("a", 10, 0.0) == pytest.approx(0.1)
    assert bucket.take("b", 10, 0.0) == 0.0
    assert bucket.take("a", 10, 0.1) == 0.0
    assert bucket.take("a", 10, 0.1) > 0


def test_bucket_remembers_so_many_callers_and_no_more() -> None:
    bucket = Bucket()
    for number in range(2 * CLIENTS_KEPT):
        bucket.take(str(number), 10, 0.0)
    assert len(bucket._used) == CLIENTS_KEPT


def test_loopback_has_no_limit_until_one_is_set(flying: Drone, api: Api, service: Service) -> None:
    service.settings = replace(ApiModuleSettings({}, environ={}).snapshot(), max_rate=10.0)
    assert {api.get("/jobs").status for _ in range(60)} == {200}
    service.settings = ApiModuleSettings({"max_rate": 10}, environ={}).snapshot()
    statuses = [api.get("/jobs").status for _ in range(40)]
    assert statuses[:20] == [200] * 20 and 429 in statuses


def test_caller_over_its_rate_is_answered_late(flying: Drone, api: Api, loop: FastLoop, service: Service) -> None:
    service.settings = ApiModuleSettings({"max_rate": 10}, environ={}).snapshot()
    statuses, began = [api.get("/jobs").status for _ in range(20)], loop.time()
    assert set(statuses) == {200}
    statuses = [api.get("/jobs").status for _ in range(20)]
    assert loop.time() - began == pytest.approx(REFUSAL_DELAY * statuses.count(429)) != 0


STOPS = [
    ("GET", "/command/land"),
    ("POST", "/command/rtl/"),
    ("GET", "/command/brake"),
    ("GET", "/command/disarm?force=true"),
    ("GET", "/movement/stop"),
    ("DELETE", "/jobs/1"),
]


@pytest.mark.parametrize(("method", "path"), STOPS)
def test_what_stops_a_vehicle_is_refused_for_no_rate(
    flying: Drone, api: Api, loop: FastLoop, service: Service, method: str, path: str
) -> None:
    service.settings = ApiModuleSettings({"max_rate": 1}, environ={}).snapshot()
    while api.get("/jobs").status != 429:
        pass
    answers = [loop.run(api.ask(method, path, headers={"Prefer": "respond-async"})) for _ in range(5)]
    assert 429 not in [answer.status for answer in answers]
    assert api.get("/command/guided").status == 429


# -- strangers at a real port -------------------------------------------------------------------------------


def test_flood_of_refusals_takes_nothing_from_the_owner_at_its_address(
    flying: Drone, port: Port, service: Service
) -> None:
    service.settings = replace(service.settings, max_rate=50.0, local_rate=50.0)

    async def act() -> tuple[list[int], list[int]]:
        floods = [(await port.ask("GET", "/command/arm")).status for _ in range(150)]
        paths = ["/jobs", "/command/brake"] * 10
        return floods, [(await port.ask("GET", path, OWNER)).status for path in paths]

    floods, owners = port.run(act)
    assert owners == [200] * 20
    assert set(floods) <= {401, 429}


def test_stranger_who_asks_too_often_is_answered_late(drone: Drone, port: Port, loop: FastLoop) -> None:
    async def act() -> tuple[list[int], float]:
        began = loop.time()
        statuses = [(await port.ask("GET", "/jobs")).status for _ in range(60)]
        return statuses, loop.time() - began

    statuses, seconds = port.run(act)
    assert statuses[:20] == [401] * 20
    assert 429 in statuses
    assert seconds > 1.0


def test_reader_of_the_documentation_needs_no_token_at_a_strangers_rate(
    loop: FastLoop, drone: Drone, port: Port
) -> None:
    loop.set_default_executor(AtOnce())  # the clock must not run while a file is read
    statuses = [port.run(lambda: port.ask("GET", "/docs")).status for _ in range(30)]
    assert statuses[:15] == [200] * 15
    assert 429 in statuses
    assert port.run(lambda: port.ask("GET", "/docs", OWNER)).status == 200
