"""Operators with tokens of their own, before a real MAVProxy: made at its prompt, used by a client and a script."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import requests

from mavproxy_uavapi.client import connect
from mavproxy_uavapi.core.errors import Busy
from tests.support.processes import Rig, eventually

pytestmark = pytest.mark.long

SCRIPT = """
import asyncio, os
from mavproxy_uavapi.client import connect

async def main():
    async with connect(os.environ["UAVAPI_URL"]) as drone:
        await drone.arm()
        print("armed", drone.armed)

asyncio.run(main())
"""


@pytest.fixture(scope="module")
def rig(harness: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    directory = tmp_path_factory.mktemp("operators")
    folders = {"scripts_path": str(directory / "scripts"), "script_logs": str(directory / "logs")}
    rig = harness.embedded(directory, logs=True, **folders)
    rig.mavproxy.ask(f"uavapi set tokens {directory / 'tokens'}", "listening on")
    yield rig
    rig.stop()


def add(rig: Rig, words: str) -> dict[str, str]:
    """A new token, as a header."""
    said = rig.mavproxy.ask(f"uavapi token add {words}", "shown this once:")
    secret = eventually(lambda: rig.mavproxy.output().partition(said)[2].split() or said.split("once:")[1].split())[0]
    return {"Authorization": f"Bearer {secret}"}


def test_operators_of_the_prompt_fly_watch_hand_over_and_go(rig: Rig) -> None:
    assert rig.get("/vehicles").status_code == 401
    anna, bo, tower = add(rig, "anna fly 1"), add(rig, "bo fly"), add(rig, "tower watch")
    assert "anna fly:1" in rig.mavproxy.ask("uavapi token list", "tower watch")
    file = rig.directory / "tokens"
    assert file.stat().st_mode & 0o777 == 0o600
    assert not any(headers["Authorization"].split()[1] in file.read_text() for headers in (anna, bo, tower))
    with requests.get(f"{rig.url}/telemetry/stream", headers=tower, stream=True, timeout=30) as stream:
        assert next(stream.iter_lines())
        assert rig.call("GET", "/command/arm", headers=tower).status_code == 403
        assert rig.call("POST", "/authority/take", json={"lease": 600}, headers=anna).status_code == 200
        asyncio.run(fly(rig.url, anna, bo))
        rig.mavproxy.ask("uavapi authority", "anna holds it")
        rig.mavproxy.ask("uavapi authority take", "console holds it")
        assert rig.call("GET", "/command/guided", headers=anna).status_code == 409
        assert rig.call("GET", "/command/rtl?wait=false", headers=anna).status_code == 202
        rig.mavproxy.ask("uavapi authority release", "nobody holds it")
        rig.mavproxy.ask("uavapi token remove tower", "is no longer valid")
        with pytest.raises(requests.RequestException):
            for _ in stream.iter_lines():
                pass
            raise requests.ConnectionError("it has ended")
    assert rig.call("GET", "/vehicles", headers=tower).status_code == 401
    assert "anna@127.0.0.1 /command/takeoff" in rig.mavproxy.ask("uavapi log", "all of them")
    audit = [path.read_text() for path in rig.directory.rglob("uavapi-audit.jsonl")]
    texts = [*audit, rig.mavproxy.output().replace(anna["Authorization"].split()[1], "", 1)]
    assert not any(anna["Authorization"].split()[1] in text for text in texts), "it is shown once, at the prompt"
    file.chmod(0o644)
    rig.mavproxy.says("chmod 600")
    assert rig.call("GET", "/vehicles", headers=anna).status_code == 200
    file.chmod(0o600)


async def fly(url: str, anna: dict[str, str], bo: dict[str, str]) -> None:
    """By the client library: anna, who holds the vehicle, flies it; bo does not."""
    tokens = [headers["Authorization"].split()[1] for headers in (anna, bo)]
    async with connect(url, tokens[0]) as hers, connect(url, tokens[1]) as his:
        with pytest.raises(Busy, match="anna holds vehicle 1"):
            await his.arm()
        await hers.arm()
        await hers.takeoff(5)
        with pytest.raises(Busy, match="anna holds vehicle 1"):
            await his.takeoff(9)


@pytest.mark.needs("tmux")
def test_script_of_an_admin_calls_by_a_token_of_its_own(rig: Rig, tmp_path: Path) -> None:
    boss, pilot = add(rig, "boss admin"), add(rig, "pilot fly")
    script = tmp_path / "arms.py"
    script.write_text(SCRIPT)
    for headers, status in ((pilot, 403), (boss, 200)):
        with script.open("rb") as file:
            answer = rig.call("POST", "/mission/upload-script", files={"file": file}, headers=headers)
        assert answer.status_code == status
    assert rig.call("POST", "/mission/execute-script", json={"script_name": "arms"}, headers=pilot).status_code == 403
    eventually(lambda: not rig.call("GET", "/vehicles/1", headers=boss).json()["armed"])
    assert rig.call("POST", "/mission/execute-script", json={"script_name": "arms"}, headers=boss).status_code == 200

    def ended() -> Any:
        run = rig.call("GET", "/mission/scripts/arms", headers=boss).json()
        return None if run["running"] else run["run"]

    run = eventually(ended)
    assert (run["exit_status"], run["out"]) == (0, "armed True\n"), run
    records = "".join(path.read_text() for path in (rig.directory / "logs").glob("*"))
    assert "sha256" not in json.dumps(run) and "UAVAPI_TOKEN" not in records
    rig.mavproxy.ask("uavapi log", "boss/arms@127.0.0.1 /command/arm")
