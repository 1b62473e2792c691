from __future__ import annotations

from pathlib import Path

import pytest

from mavproxy_uavapi.rehearsal.order import Order
from mavproxy_uavapi.rehearsal.script_runs import ScriptRuns


@pytest.mark.parametrize(
    ("files", "urls"),
    [(["a.py"], ["http://a:1"]), (["a.py", "b.py"], ["http://a:1/vehicles/1", "http://a:1/vehicles/2"])],
)
def test_each_of_several_scripts_finds_its_own_vehicle(files: list[str], urls: list[str]) -> None:
    runs = ScriptRuns(
        Order(tuple(map(Path, files))), "http://a:1", Path(), Path("/clock"), ["all", "first", "second"]
    )
    found = [runs._environment(number) for number in range(1, len(files) + 1)]
    assert [each["UAVAPI_URL"] for each in found] == urls
    assert [each["UAVAPI_MAVLINK"] for each in found] == (["all"] if len(files) == 1 else ["first", "second"])
    assert [each["UAVAPI_SYSID"] for each in found] == ["1", "2"][: len(files)]
