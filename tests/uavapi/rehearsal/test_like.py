from __future__ import annotations

from typing import Any

import pytest

from mavproxy_uavapi.core.errors import NotFound, Stale
from mavproxy_uavapi.rehearsal.like import _wind
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
