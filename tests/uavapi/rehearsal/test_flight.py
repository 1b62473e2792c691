from __future__ import annotations

import json
from pathlib import Path

import pytest

from mavproxy_uavapi.rehearsal.flight import Rehearsal
from mavproxy_uavapi.rehearsal.order import Order


def test_rehearsal_is_recorded_as_no_flight_of_the_real_vehicle() -> None:
    name, _, keywords = Rehearsal(Order((Path("a.py"),)))._options(5769, Path()).module[0].partition(":")
    assert (name, json.loads(keywords)["flights"]) == ("uavapi", "off")


@pytest.mark.parametrize(
    ("files", "urls"),
    [(["a.py"], ["http://a:1"]), (["a.py", "b.py"], ["http://a:1/vehicles/1", "http://a:1/vehicles/2"])],
)
def test_each_of_several_scripts_finds_its_own_vehicle(files: list[str], urls: list[str]) -> None:
    rehearsal = Rehearsal(Order(tuple(map(Path, files))))
    rehearsal.url = "http://a:1"
    found = [rehearsal._environment(number) for number in range(1, len(files) + 1)]
    assert [each["UAVAPI_URL"] for each in found] == urls
    assert [each["UAVAPI_SYSID"] for each in found] == ["1", "2"][: len(files)]
