"""Rehearsals beside the API: one at a time, with a token that only watches, and what counts as rehearsed."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from mavproxy_uavapi.core.errors import Busy, NotRehearsed
from mavproxy_uavapi.core.roles import Role
from mavproxy_uavapi.files import rehearsals
from mavproxy_uavapi.files.tokens import digest_of
from mavproxy_uavapi.scripts import rehearser as module
from mavproxy_uavapi.scripts.rehearser import Conditions, File, Rehearser
from tests.support.virtual_time import FastLoop

SCRIPT = File("a.py", b"fly()", "digest", ("1",))
# In place of `run`: it says what it was given, and ends with the status that the script's bytes name.
RUN = """
import json, os, pathlib, sys, time
file, like, report, *rest = sys.argv[1:]
flights = [{"faults": [one for one in rest if one.startswith("--fault")], "status": 0}]
said = {"flights": flights, "like": like, "rest": rest, "token": os.environ["UAVAPI_TOKEN"], "nice": os.nice(0)}
word = pathlib.Path(file).read_text()
time.sleep(60 * (word == "long"))
pathlib.Path(report.removeprefix("--report=")).write_text(json.dumps(said))
print("no vehicle", file=sys.stderr)
sys.exit({"fly()": 0, "bad": 2}.get(word, 3))
"""


class Scripts:
    """Of an API that flies vehicle 1."""

    def __init__(self) -> None:
        self.settings = SimpleNamespace(rehearse="require", python_path="/opt/python")

    def environment(self, token: str, system: int) -> dict[str, str]:
        return {
            "UAVAPI_URL": f"http://localhost:8000/vehicles/{system}",
            "UAVAPI_TOKEN": token,
            "PATH": "/usr/bin:/bin",
        }


@pytest.fixture
def vehicle() -> Any:
    state = SimpleNamespace(system=1, parameters={"RTL_ALT_M": 15.0, "STAT_RUNTIME": 1.0})
    return SimpleNamespace(state=state, guard=SimpleNamespace(check=SimpleNamespace(spaces=[])))


@pytest.fixture
def rehearser(loop: FastLoop, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Rehearser:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setattr(module, "RUN", [sys.executable, "-c", RUN])
    rehearsals.keep(SCRIPT.digest, "{}")
    host = SimpleNamespace(warned=[], mavlink_ports=[12345])
    host.warn = host.warned.append
    loop.real_wait = 20.0  # a process runs
    return Rehearser(host, Scripts())  # type: ignore[arg-type]


def flown(loop: FastLoop, rehearser: Rehearser, vehicle: Any, file: File = SCRIPT) -> Any:
    async def fly() -> None:
        rehearser.begin(vehicle, file, ["--seed=3"])
        with pytest.raises(Busy, match="a.py is being rehearsed"):
            rehearser.begin(vehicle, file, [])
        await rehearser.ended()

    loop.run(fly())
    assert rehearser.under_way == ""
    return rehearser.newest


def test_run_is_asked_to_be_like_our_vehicle_politely(loop: FastLoop, rehearser: Rehearser, vehicle: Any) -> None:
    outcome = flown(loop, rehearser, vehicle)
    assert outcome.report["like"] == "--like=http://localhost:8000/vehicles/1"
    assert outcome.report["rest"] == ["--python=/opt/python", "--mavlink-port=12345", "--seed=3", "--", "1"]
    assert outcome.report["nice"] == min(os.nice(0) + 15, 19)
    assert rehearser.token_of(digest_of(outcome.report["token"].encode())) is None  # it has ended


def test_token_of_a_rehearsal_watches(loop: FastLoop, rehearser: Rehearser, vehicle: Any) -> None:
    seen: list[Any] = []
    environment = rehearser._scripts.environment

    def looked(token: str, system: int) -> dict[str, str]:
        seen.extend([rehearser.token_of(digest_of(token.encode())), rehearser.token_of(digest_of(b"x"))])
        return environment(token, system)

    rehearser._scripts.environment = looked  # type: ignore[method-assign]
    flown(loop, rehearser, vehicle)
    assert seen[0].role is Role.WATCH and seen[1] is None


@pytest.mark.parametrize(("change", "counts"), [("none", True), ("RTL_ALT_M", False), ("STAT_RUNTIME", True)])
def test_what_went_well_counts_while_what_decides_its_way_is_the_same(
    loop: FastLoop, rehearser: Rehearser, vehicle: Any, change: str, counts: bool
) -> None:
    flown(loop, rehearser, vehicle)
    vehicle.state.parameters |= {change: 99.0} if change != "none" else {}
    if counts:
        rehearser.require(vehicle, "a.py", SCRIPT.digest, SCRIPT.args)
    else:
        with pytest.raises(NotRehearsed, match="POST /rehearsals"):
            rehearser.require(vehicle, "a.py", SCRIPT.digest, SCRIPT.args)
    with pytest.raises(NotRehearsed):
        rehearser.require(vehicle, "a.py", SCRIPT.digest, ("2",))


def test_what_went_badly_does_not_count_and_what_was_not_flown_says_why(
    loop: FastLoop, rehearser: Rehearser, vehicle: Any
) -> None:
    assert flown(loop, rehearser, vehicle, SCRIPT._replace(content=b"bad")).report is not None
    assert rehearsals.vouched(SCRIPT.digest) == ""
    outcome = flown(loop, rehearser, vehicle, SCRIPT._replace(content=b"nothing"))
    assert (outcome.report, outcome.failure) == (None, "no vehicle")


def test_flight_in_which_something_goes_wrong_proves_nothing(
    loop: FastLoop, rehearser: Rehearser, vehicle: Any
) -> None:
    async def fly(*options: str) -> None:
        rehearser.begin(vehicle, SCRIPT, options)
        await rehearser.ended()

    loop.run(fly("--fault=script_killed@leg1"))
    assert rehearsals.vouched(SCRIPT.digest) == ""
    loop.run(fly())
    assert rehearsals.vouched(SCRIPT.digest)


def test_one_that_is_ended_leaves_nothing(loop: FastLoop, rehearser: Rehearser, vehicle: Any, tmp_path: Path) -> None:
    async def begin_and_end() -> None:
        rehearser.begin(vehicle, SCRIPT._replace(content=b"long"), [])
        await rehearser.end()

    loop.run(begin_and_end())
    assert (rehearser.under_way, rehearser.newest) == ("", None)
    assert flown(loop, rehearser, vehicle).report is not None


def test_off_asks_for_nothing_and_warn_warns(rehearser: Rehearser, vehicle: Any) -> None:
    settings: Any = rehearser._scripts.settings
    settings.rehearse = "off"
    rehearser.require(vehicle, "a.py", "unknown")
    settings.rehearse = "warn"
    rehearser.require(vehicle, "a.py", "unknown")
    assert len(rehearser._host.warned) == 1  # type: ignore[attr-defined]


def test_parameter_that_was_not_known_then_does_not_count_and_one_that_is_not_known_now_does(vehicle: Any) -> None:
    before = Conditions.of(vehicle, ())
    vehicle.state.parameters |= {"WP_SPD": 5.0}
    assert Conditions.of(vehicle, ()).fit(before)
    assert not before.fit(Conditions.of(vehicle, ()))  # MAVProxy has just begun, or it is a vehicle of another type
    after = Conditions.of(vehicle, ())
    vehicle.state.parameters |= {"WP_SPD": 6.0}
    assert not after.fit(Conditions.of(vehicle, ()))
