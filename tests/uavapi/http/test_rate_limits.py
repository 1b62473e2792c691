from __future__ import annotations

from typing import Any

import pytest

from mavproxy_uavapi.http.bucket import BURST, CLIENTS_KEPT, Bucket
from mavproxy_uavapi.settings import ApiModuleSettings


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


def test_loopback_has_no_limit_until_one_is_set(flying: Any, api: Any, service: Any) -> None:
    assert {api.get("/jobs").status for _ in range(1200)} == {200}
    service.settings = ApiModuleSettings({"max_rate": 10}, environ={}).snapshot()
    statuses = [api.get("/jobs").status for _ in range(40)]
    assert statuses[:20] == [200] * 20 and 429 in statuses


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
    flying: Any, api: Any, loop: Any, service: Any, method: str, path: str
) -> None:
    service.settings = ApiModuleSettings({"max_rate": 1}, environ={}).snapshot()
    while api.get("/jobs").status != 429:
        pass
    answers = [loop.run(api.ask(method, path, headers={"Prefer": "respond-async"})) for _ in range(5)]
    assert 429 not in [answer.status for answer in answers]
    assert api.get("/command/guided").status == 429
