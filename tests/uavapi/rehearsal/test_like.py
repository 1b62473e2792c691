from __future__ import annotations

from typing import Any

import pytest

from mavproxy_uavapi.core.errors import NotFound, Stale
from mavproxy_uavapi.rehearsal.like import _camera, _wind
from tests.support.virtual_time import FastLoop


class Api:
    """That answers one question."""

    def __init__(self, answer: Any) -> None:
        self._answer = answer

    async def get(self, path: str) -> Any:
        assert path == "/telemetry/message/WIND"
        if isinstance(self._answer, Exception):
            raise self._answer
        return {"info": self._answer}


@pytest.mark.parametrize(
    ("answer", "wind"),
    [
        ({"speed": 4.24, "direction": -90.0}, "4.2,270"),
        (NotFound("it has not sent WIND"), ""),
        (Stale("it is 60 s old"), ""),
    ],
)
def test_wind_is_that_which_the_vehicle_tells_now(loop: FastLoop, answer: Any, wind: str) -> None:
    assert loop.run(_wind(Api(answer))) == wind  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("source", "taken"), [("sim", {"descent": 0.5, "sim_tags": "0:0.3@1,2"}), ("http", {"descent": 0.5})]
)
def test_camera_is_as_it_was_set_but_where_its_pictures_come_from(source: str, taken: dict[str, Any]) -> None:
    rows = [
        {"name": "source", "value": source, "origin": "vision set"},
        {"name": "vehicle", "value": 7, "origin": "environment"},
        {"name": "descent", "value": 0.5, "origin": "vision set"},
        {"name": "attempts", "value": 5, "origin": "default"},
        {"name": "sim_tags", "value": "0:0.3@1,2", "origin": "vision set"},
    ]
    assert _camera(rows) == taken
