"""/mission: scripts, each in a tmux session of its own."""

from __future__ import annotations

import asyncio
import hashlib
import json
import time
from contextlib import suppress
from typing import Annotated, cast

from aiohttp import web
from typing_extensions import NotRequired, TypedDict

from mavproxy_uavapi.core.errors import NotFound
from mavproxy_uavapi.core.streaming import COMMENT, KEEP_ALIVE, EventStream
from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.contract.answers import Moment, Success, means
from mavproxy_uavapi.http.contract.requests import ExecuteScript, ScriptLog, ScriptName, UploadedFile
from mavproxy_uavapi.http.contract.responses import dumps, envelope
from mavproxy_uavapi.http.contract.route import FILE_FORM
from mavproxy_uavapi.http.door.access import require_owner
from mavproxy_uavapi.http.handlers.rehearsals import require_rehearsed_script
from mavproxy_uavapi.http.wire.forms import file_of
from mavproxy_uavapi.scripts import clients, names, runs
from mavproxy_uavapi.scripts.follower import Follower
from mavproxy_uavapi.scripts.manager import Scripts
from mavproxy_uavapi.scripts.runs import Run

# The numbers of these answers that clients of the original service expect.
FILE = {"multipart/form-data": FILE_FORM}
SAVED, LISTED, STARTED, CLEARED, RUNNING, STOPPED = 44, 42, 46, 48, 50, 52

LOG_SERVED = 1024 * 1024  # bytes of the end of a log
FOLLOW_EVERY = 0.25  # s between looks at a log, because a file does not signal its growth


LOGS = "/home/pilot/uav_scripts/logs/square_20260102_030405"


class RunReport(TypedDict):
    """A run of a script."""

    script: Annotated[str, means("its name", "square.py")]
    args: Annotated[list[str], means("its command-line arguments", ["10"])]
    session: Annotated[str, means("of tmux", "uavapi_1_square_20260102_030405")]
    attach: Annotated[str, means("a command line that shows it", "tmux attach -t uavapi_1_square_20260102_030405")]
    started_at: Moment
    out_log: Annotated[str, means("a file of this machine", f"{LOGS}_out.log")]
    err_log: Annotated[str, means("a file of this machine", f"{LOGS}_err.log")]
    running: bool
    running_for_s: NotRequired[Annotated[float, means("s, while it runs", 12.5)]]
    stopping: NotRequired[Annotated[bool, means("while it runs", False)]]
    kill_in_s: NotRequired[Annotated[float, means("s until it is killed, while it is being stopped", 8.0)]]
    ended_at: NotRequired[Moment | None]
    exit_status: NotRequired[Annotated[int | None, means("once it has ended", 0)]]
    killed: NotRequired[Annotated[bool, means("once it has ended", False)]]
    error: NotRequired[Annotated[str, means("why it could not be started", "no such file")]]


class ProcessReport(TypedDict):
    """A process of a script."""

    pid: Annotated[int, means("of this machine", 4711)]
    command: Annotated[str, means("its command line", "python3 square.py 10")]


class RunWithProcesses(RunReport):
    """A run and its processes."""

    processes: list[ProcessReport]


class LogEnds(TypedDict):
    """The ends of a run's logs."""

    out: Annotated[str, means("the end of its output", "landed\n")]
    err: Annotated[str, means("the end of its error output", "")]


class RunWithLogs(RunReport, LogEnds):
    """A run and the ends of its logs."""


class OfScripts(Success):
    """An answer about scripts."""

    type: Annotated[int, means("the number that clients of the original service know it by", SAVED)]


class Saved(OfScripts):
    """A script was saved, or stopped."""

    info: Annotated[str, means("a sentence", "Removed 1 script(s)")]


class ScriptList(OfScripts):
    """The uploaded scripts by their names."""

    scripts: Annotated[list[str], means("of Python", ["square.py"])]
    shell_scripts: Annotated[list[str], means("of a shell", ["patrol.sh"])]


class Started(OfScripts, RunReport):
    """A script that was started; the ends of its logs if it has ended already."""

    out: NotRequired[Annotated[str, means("the end of its output", "")]]
    err: NotRequired[Annotated[str, means("the end of its error output", "ModuleNotFoundError: No module named 'x'")]]


class Running(OfScripts):
    """The scripts that run."""

    scripts: list[RunWithProcesses]


class StoppedScript(Saved, RunReport):
    """A script that was stopped."""


class Cleared(Saved):
    """Scripts that were removed."""

    removed: Annotated[list[str], means("their names", ["square.py"])]


class NewestRun(Success):
    """A script and its newest run."""

    script: Annotated[str, means("its name", "square.py")]
    running: bool
    run: RunWithLogs | None


class NeverRun(NewestRun):
    """A script that never ran."""

    path: Annotated[str, means("its file", "/home/pilot/uav_scripts/square.py")]


async def upload_script(call: Call) -> Saved:
    """Save a .py or .sh file, sent as the multipart field `file`; it replaces one of the same name."""
    scripts = _scripts(call)
    name, data = await file_of(call.request, scripts.store.size_limit, names.checked)
    digest = await asyncio.to_thread(hashlib.sha256, data)
    call.remembered = UploadedFile(file=name, sha256=digest.hexdigest())
    path = await scripts.save(name, data)
    return {**_answer(call), "type": SAVED, "info": f"Mission File '{name}' saved at {path} successfully."}


async def list_scripts(call: Call) -> ScriptList:
    """The uploaded .py scripts; `shell_scripts` has the .sh ones."""
    store = _scripts(call).store
    python = await asyncio.to_thread(store.listed, (".py",))
    shell = await asyncio.to_thread(store.listed, (".sh",))
    return {**_answer(call), "type": LISTED, "scripts": python, "shell_scripts": shell}


async def execute_script(call: Call) -> Started:
    """Run a script in a tmux session of its own, for the vehicle of the path; answers half a second after it began.

    One that has ended before is reported so: `running` false, `exit_status`, and what it wrote.
    """
    scripts, p = _scripts(call), call.params(ExecuteScript)
    rehearsed = await require_rehearsed_script(call, p.script_name, p.args)
    operator = call.caller.operator.name
    run = await scripts.execute(p.script_name, p.args, operator, call.named_system, content=rehearsed)
    answer = {**_answer(call), "type": STARTED, **_report(run)}
    return cast(Started, answer if run.running else {**answer, **await _log_ends(run)})


async def running_scripts(call: Call) -> Running:
    """The scripts that run now, and their processes; for those being stopped also the seconds until the kill."""
    running = await _scripts(call).running()
    families = [await asyncio.to_thread(clients.processes, run) for run in running]
    reports: list[RunWithProcesses] = [
        {**_report(run), "processes": cast(list[ProcessReport], family)}
        for run, family in zip(running, families, strict=True)
    ]
    return {**_answer(call), "type": RUNNING, "scripts": reports}


async def stop_script(call: Call) -> StoppedScript:
    """Stop a script by Ctrl-C, so that it can land the vehicle; kill it after the grace period; wait for its end."""
    run = await _scripts(call).halt(call.params(ScriptName).script_name)
    return {**_answer(call), "type": STOPPED, "info": "Stopped", **_report(run)}


async def clear_scripts(call: Call) -> Cleared:
    """Remove all uploaded scripts. Running scripts go on; logs stay."""
    removed = await asyncio.to_thread(_scripts(call).store.clear)
    return {**_answer(call), "type": CLEARED, "info": f"Removed {len(removed)} script(s)", "removed": removed}


async def show_script(call: Call) -> NewestRun | NeverRun:
    """A script's newest run: whether it still runs, its exit status, and the ends of both logs."""
    scripts, script = _scripts(call), _script_of(call)
    run = await scripts.newest(script)
    if run is None:
        path = await asyncio.to_thread(scripts.store.find, script)
        return {**_answer(call), "script": script, "path": str(path), "running": False, "run": None}
    report: RunWithLogs = {**_report(run), **await _log_ends(run)}
    return {**_answer(call), "script": script, "running": run.running, "run": report}


async def script_log(call: Call) -> web.StreamResponse:
    """The end of a log of a script's newest run, as text; with `follow` both logs as they grow."""
    scripts, script, p = _scripts(call), _script_of(call), call.params(ScriptLog)
    run = await scripts.newest(script)
    if run is None:
        raise NotFound(f"{script} never ran")
    if p.follow:
        with call.one_more_stream():
            return await _follow(call, run)
    text = await asyncio.to_thread(runs.tail, run.out_log if p.stream == "out" else run.err_log, LOG_SERVED)
    return web.Response(text=text, content_type="text/plain", charset="utf-8")


# -- helpers ------------------------------------------------------------------------------------------------


def _scripts(call: Call) -> Scripts:
    """The scripts, if the caller may use them.

    Raises:
        Forbidden: the caller has no token, is not a program of this machine, and its network is not in the settings.
    """
    require_owner(call, "scripts run on this machine")
    return call.service.scripts


def _script_of(call: Call) -> str:
    return names.resolved(call.names["name"])


def _answer(call: Call) -> Success:
    """What a success begins with, also without a vehicle, because scripts do not need one."""
    return envelope(call.service.scripts.sysid, "success")


async def _log_ends(run: Run) -> LogEnds:
    return {
        "out": await asyncio.to_thread(runs.tail, run.out_log),
        "err": await asyncio.to_thread(runs.tail, run.err_log),
    }


def _report(run: Run) -> RunReport:
    return cast(RunReport, run.report(time.time()))


async def _follow(call: Call, run: Run) -> web.StreamResponse:
    """Send both logs from their beginning, line by line, then how the run ended."""
    response = EventStream()
    followers = {"out": Follower(run.out_log), "err": Follower(run.err_log)}
    now = asyncio.get_running_loop().time
    said_at = now()
    with suppress(ConnectionError):  # the client has gone or reads no more; following ends so
        await response.prepare(call.request)
        while True:
            run, events = await asyncio.to_thread(_next_events, run, followers)
            if not events and now() - said_at > KEEP_ALIVE:
                events = COMMENT
            if events:
                await response.write(events)
                said_at = now()
            if any(follower.behind for follower in followers.values()):
                await call.service.host.bridge.wait_for_main_loop()
            elif run.running:
                await asyncio.sleep(FOLLOW_EVERY)
            else:
                await response.write(f"event: end\ndata: {dumps(_report(run))}\n\n".encode())
                return response
    return response


def _next_events(run: Run, followers: dict[str, Follower]) -> tuple[Run, bytes]:
    """The run's present state, and an event for each of the next lines. Blocking."""
    run = runs.refreshed(run)  # before the logs, so that nothing of them is missed
    events = [_events(kind, follower.lines(not run.running)) for kind, follower in followers.items()]
    return run, "".join(events).encode()


def _events(kind: str, lines: list[str]) -> str:
    """An event for each line; all lines are encoded at once, because a log may have a million."""
    if not lines:
        return ""
    before, after = f'event: {kind}\ndata: {{"line": ', "}\n\n"
    return before + json.dumps(lines, separators=(after + before, ": "))[1:-1] + after
