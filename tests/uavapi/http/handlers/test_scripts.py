from __future__ import annotations

import hashlib
import io
import json
import tracemalloc
from collections.abc import Callable
from ipaddress import ip_address
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from aiohttp import FormData

from mavproxy_uavapi.core.errors import BadRequest, Forbidden, ToolFailed
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.http.callers.call import Service
from mavproxy_uavapi.http.callers.caller import CALLER, Caller
from mavproxy_uavapi.http.handlers.scripts import _scripts
from mavproxy_uavapi.scripts import runs
from mavproxy_uavapi.scripts.manager import Scripts
from mavproxy_uavapi.scripts.rehearser import Rehearser
from mavproxy_uavapi.settings import ApiModuleSettings
from tests.support.drone import Drone
from tests.support.virtual_time import FastLoop
from tests.uavapi.http.conftest import Api

THREAD_WAIT = 10.0  # real s; an idle loop waits for the thread that reads the file, and its clock stands
FILE_WAIT = 2.0  # real s that the executor gets with its files before the clock jumps


@pytest.fixture
def configured(api: Api, loop: FastLoop, service: Service, tmp_path: Path) -> Callable[..., Scripts]:
    """`configured(**settings)`: the service with those, and its scripts in a folder of the test's."""
    loop.real_wait = FILE_WAIT

    def configure(**keywords: Any) -> Any:
        folders = {"scripts_path": str(tmp_path / "scripts"), "script_logs": str(tmp_path / "logs")}
        service.settings = ApiModuleSettings({**folders, **keywords}, environ={}).snapshot()
        service.scripts = Scripts(service.host, service.settings)
        return service.scripts

    configure()
    return configure


@pytest.fixture
def scripts(configured: Callable[..., Scripts], service: Service) -> Scripts:
    return service.scripts


def form(name: str = "a.py", data: bytes = b"print(1)\n", field: str = "file") -> FormData:
    filled = FormData()
    filled.add_field(field, io.BytesIO(data), filename=name)
    return filled


def upload(api: Api, *args: Any, **kwargs: Any) -> Any:
    return api.post("/mission/upload-script", data=form(*args, **kwargs))


def test_upload_and_list_need_no_vehicle(api: Api, scripts: Scripts) -> None:
    answer = upload(api, "b.py")
    path = scripts.store.folder / "b.py"
    assert answer.status == 200
    assert answer.body == {
        "device": "uav",
        "id": "0",
        "result": "success",
        "type": 44,
        "info": f"Mission File 'b.py' saved at {path} successfully.",
    }
    assert path.read_bytes() == b"print(1)\n"
    upload(api, "a.py")
    upload(api, "c.sh")
    listed = api.get("/mission/list-scripts").body
    assert (listed["type"], listed["scripts"], listed["shell_scripts"]) == (42, ["a.py", "b.py"], ["c.sh"])


@pytest.mark.parametrize("name", ["a.txt", "a", "../a.py", "x$(touch PWN).py", "a b.py", ".a.py"])
def test_upload_of_an_unfit_name_is_400_and_saves_nothing(api: Api, scripts: Scripts, name: str) -> None:
    answer = upload(api, name)
    assert (answer.status, answer.body["code"]) == (400, "bad_request")
    assert not scripts.store.folder.exists()


def test_upload_is_in_the_trail_by_its_name_and_hash(api: Api, scripts: Scripts, host: Host) -> None:
    upload(api, data=b"print(2)\n")
    (entry,) = host.audit.entries
    assert entry.request == {"file": "a.py", "sha256": hashlib.sha256(b"print(2)\n").hexdigest()}


def test_upload_without_a_file_is_400(api: Api, scripts: Scripts) -> None:
    assert upload(api, field="files").status == 422
    assert api.post("/mission/upload-script", {"file": "a.py"}).status == 400
    assert api.post("/mission/upload-script").status == 400
    broken = {"data": b"nonsense", "headers": {"Content-Type": "multipart/form-data"}}
    assert api.post("/mission/upload-script", **broken).status == 400
    broken["headers"] = {"Content-Type": "multipart/form-data; boundary=x"}
    assert api.post("/mission/upload-script", **broken).status == 400


def test_upload_above_the_limits_is_400(api: Api, configured: Callable[..., Scripts]) -> None:
    configured(script_size=1)
    assert upload(api, data=b"x" * 1024).status == 200
    answer = upload(api, "b.py", data=b"x" * 1025)
    assert answer.status == 400
    assert "1 kB" in answer.body["detail"]


def test_clear_removes_all_by_both_paths(api: Api, loop: FastLoop, scripts: Scripts) -> None:
    for path in ("/mission/clear-scripts", "/mission/clear/"):
        upload(api, "a.py")
        upload(api, "b.sh")
        body = loop.run(api.ask("DELETE", path)).body
        assert (body["type"], body["info"], body["removed"]) == (48, "Removed 2 script(s)", ["a.py", "b.sh"])
    assert api.get("/mission/list-scripts").body["scripts"] == []


def test_execute_passes_name_and_arguments_and_reports_the_session(
    api: Api, scripts: Scripts, drone: Drone, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    requested: list[Any] = []

    async def execute(name: str, args: list[str], operator: str, system: int, content: Any) -> runs.Run:
        requested.append((name, args, operator, system, content))
        return runs.Run(
            tmp_path, "a.py", args, "uavapi_1_a", 1, 8000, 1e9, tmp_path / "o", tmp_path / "e", 10.0, alive=True
        )

    monkeypatch.setattr(scripts, "execute", execute)
    answer = api.post("/mission/execute-script", {"script_name": "a", "args": ["x y", ";"]})
    api.post("/vehicles/2/mission/execute-script", {"script_name": "b"})
    assert requested == [("a", ["x y", ";"], "127.0.0.1", 0, None), ("b", [], "127.0.0.1", 2, None)]
    assert (answer.status, answer.body["type"], answer.body["script"]) == (200, 46, "a.py")
    assert (answer.body["id"], answer.body["session"]) == ("1", "uavapi_1_a")


@pytest.mark.parametrize(
    ("rehearse", "status", "executed"),
    [("off", 200, [None]), ("warn", 200, [None]), ("require", 409, []), ("rehearsed", 200, [b"print(1)\n"])],
)
def test_unrehearsed_script_runs_unless_that_is_required_then_as_rehearsed(
    api: Api,
    configured: Callable[..., Scripts],
    service: Service,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    rehearse: str,
    status: int,
    executed: list[Any],
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    scripts = configured(rehearse=rehearse.replace("rehearsed", "require"))
    service.rehearser = Rehearser(service.host, scripts)
    upload(api)
    if rehearse == "rehearsed":
        monkeypatch.setattr(service.rehearser, "require", lambda *_: None)
    contents: list[Any] = []

    async def execute(*args: Any, content: Any) -> runs.Run:
        scripts.store.save("a.py", b"print(2)\n")  # somebody uploads another one meanwhile
        contents.append(content)
        return runs.Run(tmp_path, "a.py", [], "s", 1, 8000, 1e9, tmp_path, tmp_path, 10.0, alive=True)

    monkeypatch.setattr(scripts, "execute", execute)
    answer = api.post("/mission/execute-script", {"script_name": "a"})  # no vehicle is there yet
    assert (answer.status, contents) == (status, executed), answer.body
    assert status == 200 or answer.body["code"] == "not_rehearsed"


@pytest.mark.parametrize(
    "body", [{}, {"script_name": ""}, {"script_name": "a", "args": "x"}, {"script_name": "a", "args": ["\0"]}]
)
def test_execute_of_nonsense_is_422(api: Api, scripts: Scripts, body: dict[str, Any]) -> None:
    assert api.post("/mission/execute-script", body).status == 422


@pytest.mark.parametrize("path", ["/mission/execute-script", "/mission/stop-script"])
def test_unknown_script_is_404_and_an_unfit_name_400(api: Api, scripts: Scripts, path: str) -> None:
    assert api.post(path, {"script_name": "nope"}).status == 404
    assert api.post(path, {"script_name": "../a"}).status == 400


def test_stop_of_a_script_that_does_not_run_is_400(api: Api, scripts: Scripts) -> None:
    upload(api)
    answer = api.post("/mission/stop-script", {"script_name": "a"})
    assert (answer.status, answer.body["detail"]) == (400, "a.py is not running")


@pytest.mark.parametrize(
    ("error", "status"), [(ToolFailed("no tmux", "its words"), 500), (BadRequest("a.py is already running"), 400)]
)
def test_failures_to_execute_are_reported(
    api: Api, scripts: Scripts, monkeypatch: pytest.MonkeyPatch, error: Exception, status: int
) -> None:
    async def fail(*_: Any, **__: Any) -> None:
        raise error

    monkeypatch.setattr(scripts, "execute", fail)
    answer = api.post("/mission/execute-script", {"script_name": "a"})
    assert (answer.status, answer.body.get("stderr")) == (status, getattr(error, "stderr", None))


def test_running_scripts_of_none(api: Api, scripts: Scripts) -> None:
    body = api.get("/mission/running-scripts").body
    assert (body["type"], body["scripts"]) == (50, [])


def test_script_that_never_ran_has_no_run_and_no_log(api: Api, scripts: Scripts) -> None:
    upload(api)
    assert api.get("/mission/scripts/a").body["run"] is None
    assert api.get("/mission/scripts/a/log").status == 404
    assert api.get("/mission/scripts/b").status == 404
    assert api.get("/mission/scripts/a$b").status == 400


@pytest.fixture
def ran(scripts: Scripts, tmp_path: Path) -> runs.Run:
    """A run that has ended, by its record."""
    run = runs.create(scripts.logs, "a.py", [], 1, command=["x"], cwd=tmp_path, port=8000, grace=1.0, environment={})
    run.path.write_text(run.path.read_text()[:-1] + ', "pid": 1, "exit_status": 3, "ended_at": 2e9}')
    run.out_log.write_bytes(b"one\ntwo")
    run.err_log.write_bytes("ouch \u00fc\n".encode())
    return run


@pytest.mark.usefixtures("ran")
def test_ended_run_is_reported_with_its_status_and_the_ends_of_its_logs(api: Api) -> None:
    body = api.get("/mission/scripts/a.py").body
    assert (body["script"], body["running"]) == ("a.py", False)
    assert (body["run"]["exit_status"], body["run"]["out"], body["run"]["err"]) == (3, "one\ntwo", "ouch \u00fc\n")


@pytest.mark.usefixtures("ran")
def test_log_is_text_and_following_ends_with_the_run(api: Api, loop: FastLoop) -> None:
    async def read(query: str) -> SimpleNamespace:
        async with api.client.get(f"/mission/scripts/a/log{query}") as response:
            return SimpleNamespace(kind=response.content_type, text=await response.text())

    assert loop.run(read("?stream=err")) == SimpleNamespace(kind="text/plain", text="ouch \u00fc\n")
    followed = loop.run(read("?follow=1"))
    assert followed.kind == "text/event-stream"
    events = followed.text.strip().split("\n\n")
    assert events[:2] == ['event: out\ndata: {"line": "one"}', 'event: out\ndata: {"line": "two"}']
    assert events[2].startswith("event: err\n")
    assert events[3].startswith("event: end\n") and '"exit_status": 3' in events[3]


def test_log_of_an_ended_run_comes_in_pieces(api: Api, loop: FastLoop, ran: runs.Run) -> None:
    ran.out_log.write_bytes(b"x\n" * 200_000)
    loop.real_wait = THREAD_WAIT

    async def count() -> int:
        line_ends = 0
        async with api.client.get("/mission/scripts/a/log?follow=1") as response:
            async for chunk in response.content.iter_any():
                line_ends += chunk.count(b"\n")
        return line_ends // 3  # of each event

    tracemalloc.start()
    try:
        events = loop.run(count())
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert events == 200_000 + 2
    assert peak < 10e6


def test_lines_come_as_they_are(api: Api, loop: FastLoop, ran: runs.Run) -> None:
    lines = ['", "', '"}', "\\", "\x1b[0m\x00", "", 'event: end\\ndata: {"line": "', "\u2028\u00e9"]
    ran.out_log.write_text("\n".join(lines), encoding="utf-8")

    async def read() -> str:
        async with api.client.get("/mission/scripts/a/log?follow=1") as response:
            return await response.text()

    events = [event.split("\ndata: ") for event in loop.run(read()).strip().split("\n\n")]
    assert [json.loads(data)["line"] for kind, data in events if kind == "event: out"] == lines


PATHS = [
    ("POST", "/mission/upload-script"),
    ("GET", "/mission/list-scripts"),
    ("POST", "/mission/execute-script"),
    ("POST", "/mission/stop-script"),
    ("GET", "/mission/running-scripts"),
    ("GET", "/mission/scripts/a"),
    ("DELETE", "/mission/clear"),
]


@pytest.mark.parametrize(("method", "path"), PATHS)
def test_scripts_are_for_this_machine_and_for_the_token(
    api: Api, loop: FastLoop, configured: Callable[..., Scripts], method: str, path: str
) -> None:
    body = {"json": {"script_name": "a"}} if method == "POST" else {}
    body = {"data": {"file": io.BytesIO()}} if "upload" in path else body
    configured(host="0.0.0.0", allow_open=True)
    answer = loop.run(api.ask(method, path, headers={"X-Forwarded-For": "192.0.2.1"}, **body))
    assert (answer.status, answer.body["code"]) == (403, "forbidden")
    assert loop.run(api.ask(method, path, **body)).status not in (401, 403)
    configured(host="0.0.0.0", token="t")
    answer = loop.run(api.ask(method, path, headers={"Authorization": "Bearer t"}, **body))
    assert answer.status not in (401, 403)
    assert loop.run(api.ask(method, path, **body)).status == 401


@pytest.mark.parametrize(
    ("keywords", "caller", "may"),
    [
        ({"token": "t", "allow_from": "10.0.0.0/8"}, Caller(ip_address("10.0.0.5")), False),
        ({"token": "t", "allow_from": "10.0.0.0/8"}, Caller(ip_address("10.0.0.5"), has_token=True), True),
        ({"allow_from": "10.0.0.0/8"}, Caller(ip_address("127.0.0.1")), True),
        ({"allow_from": "10.0.0.0/8"}, Caller(ip_address("127.0.0.1"), forwarded=True), False),
        ({"allow_from": "10.0.0.0/8", "allow_scripts_from": "10.0.0.0/24"}, Caller(ip_address("10.0.0.5")), True),
        ({"allow_from": "10.0.0.0/8", "allow_scripts_from": "10.0.0.0/24"}, Caller(ip_address("10.0.1.5")), False),
    ],
    ids=["network", "token", "here", "by a proxy", "named for scripts", "named for flying only"],
)
def test_network_that_may_fly_may_not_run_scripts_unless_named_for_that(
    configured: Callable[..., Scripts], service: Service, keywords: dict[str, Any], caller: Caller, may: bool
) -> None:
    configured(host="0.0.0.0", **keywords)
    call = SimpleNamespace(service=service, request={CALLER: caller})
    if may:
        assert _scripts(call) is service.scripts  # type: ignore[arg-type]
    else:
        with pytest.raises(Forbidden, match="token"):
            _scripts(call)  # type: ignore[arg-type]


@pytest.mark.usefixtures("scripts")
def test_page_of_another_site_cannot_upload(api: Api) -> None:
    answer = api.post("/mission/upload-script", data=form(), headers={"Origin": "http://evil.example"})
    assert answer.status == 403
