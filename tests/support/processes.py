"""Real processes: a vehicle, a MAVProxy with our modules, and a client that speaks HTTP like any other.

The vehicle is the embedded one; tests marked `sitl` run the same flights on ArduPilot's, started by its own
sim_vehicle.py, where ARDUPILOT_HOME names a built copy.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import socket
import subprocess
import sys
import sysconfig
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import requests

from tests.support.back_door import BackDoor, RemoteDoor
from tests.support.calls import PendingCall, ThreadedCall
from tests.support.ports import free_instance, free_port
from tests.support.relay import Relay

SCRIPTS = Path(sysconfig.get_path("scripts"))
MAVPROXY = [sys.executable, str(SCRIPTS / "mavproxy.py")]
HOME = "-35.363261,149.165230,584,353"
SPEEDUP = 10
STREAM_RATE = 1  # Hz of the vehicle's clock, which is 10 of ours: MAVProxy spends its time on messages
FEW_MODULES = "log,signing,wp,rally,fence,ftp,param,arm,mode,rc,misc,cmdlong,output"
# A copter whose landings and returns are quick. It stays armed on the ground for longer than ArduPilot's 10 s, which
# are 1 s here.
PARAMETERS = {"LAND_SPD_MS": 1.0, "RTL_ALT_M": 0, "RTL_LOIT_TIME": 500, "DISARM_DELAY": 120}
SILENCE = 15  # s after which the API misses a vehicle, or its telemetry
TIMEOUT = 60.0  # s for a process to show what it should


def eventually(look: Callable[[], Any], timeout: float = TIMEOUT, what: str = "it") -> Any:
    """The first true value of `look`, called until then; other processes have no clock of ours."""
    deadline = time.monotonic() + timeout
    while True:
        value = look()
        if value:
            return value
        if time.monotonic() > deadline:
            raise AssertionError(f"{what} did not happen within {timeout:g} s")
        time.sleep(0.05)


class Process:
    """A child process with its own process group, whose output goes to a file."""

    def __init__(self, command: list[str], log: Path, cwd: Path, env: dict[str, str] | None = None) -> None:
        self.log = log
        with log.open("ab") as output:
            self.popen = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=output,
                stderr=subprocess.STDOUT,
                cwd=cwd,
                env={**os.environ, "PYTHONUNBUFFERED": "1", **(env or {})},
                start_new_session=True,
            )

    @property
    def pid(self) -> int:
        return self.popen.pid

    def output(self, since: int = 0) -> str:
        """What it has written, from byte `since` on."""
        return self.log.read_bytes()[since:].decode(errors="replace")

    def mark(self) -> int:
        """Where its output ends now."""
        return self.log.stat().st_size

    def type(self, line: str) -> None:
        """Type a line at its prompt."""
        assert self.popen.stdin is not None
        self.popen.stdin.write(line.encode() + b"\n")
        self.popen.stdin.flush()

    def says(self, text: str, since: int = 0, timeout: float = TIMEOUT) -> str:
        """Wait until its output holds `text`; what it wrote since."""
        eventually(lambda: self._has(text, since), timeout, f"{text!r} in {self.log.name}")
        return self.output(since)

    def _has(self, text: str, since: int) -> bool:
        if text in self.output(since):
            return True
        self.require_running()
        return False

    def require_running(self) -> None:
        """Fail if it has ended, with its last words."""
        assert self.popen.poll() is None, f"{self.log.name} ended: {self.output()[-2000:]}"

    def ask(self, line: str, answer: str, timeout: float = TIMEOUT) -> str:
        """Type a line and wait for `answer`; what was written meanwhile."""
        mark = self.mark()
        self.type(line)
        return self.says(answer, mark, timeout)

    def stop(self) -> None:
        """End it, and all its children."""
        assert self.popen.stdin is not None
        with contextlib.suppress(BrokenPipeError):
            self.popen.stdin.close()  # a MAVProxy that waits for a line heeds its end rather than a signal
        for sign in (signal.SIGTERM, signal.SIGKILL):
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.popen.pid, sign)
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.popen.wait(10)


class Rig:
    """A vehicle and a MAVProxy that flies it."""

    def __init__(self, directory: Path, port: int) -> None:
        self.directory = directory
        self.port = port
        self.url = f"http://127.0.0.1:{port}"
        self.processes: list[Process] = []
        self.control: BackDoor | None = None
        self.is_ardupilot = False
        self.mavproxy: Process

    def call(self, method: str, path: str, *, timeout: float = 120, **content: Any) -> Any:
        """A request and its answer; `content` is of `requests.request`."""
        return requests.request(method, self.url + path, timeout=timeout, **content)

    def get(self, path: str, timeout: float = 120, **params: Any) -> Any:
        return self.call("GET", path, params=params, timeout=timeout)

    def post(self, path: str, timeout: float = 120, **body: Any) -> Any:
        return self.call("POST", path, json=body, timeout=timeout)

    def delete(self, path: str) -> Any:
        return self.call("DELETE", path)

    def begin(self, method: str, path: str, body: dict[str, Any] | None = None) -> PendingCall:
        """A request whose answer is waited for later."""
        return ThreadedCall(lambda: self.call(method, path, json=body))

    def hang_up(self, method: str, path: str, body: dict[str, Any] | None = None, after: float = 0.5) -> None:
        """Ask, and hang up after so many s without an answer."""
        with requests.Session() as session, contextlib.suppress(requests.ReadTimeout):
            session.request(method, self.url + path, json=body, timeout=(5, after))
            raise AssertionError("it answered too soon")

    @contextlib.contextmanager
    def unanswered(self, method: str, path: str, body: dict[str, Any] | None = None) -> Iterator[None]:
        """Meanwhile a request waits for its answer; then its client hangs up."""
        with socket.create_connection(("127.0.0.1", self.port), timeout=TIMEOUT) as connection:
            content = b"" if body is None else json.dumps(body).encode()
            lines = (f"{method} {path} HTTP/1.1", f"Host: 127.0.0.1:{self.port}", "Content-Type: application/json")
            connection.sendall("\r\n".join([*lines, f"Content-Length: {len(content)}", "", ""]).encode() + content)
            yield
            assert select.select([connection], [], [], 0)[0] == [], "it answered too soon"

    def ok(self, answer: Any) -> dict[str, Any]:
        """The body of an answer that must be a success."""
        assert answer.status_code == 200, f"{answer.status_code} {answer.text}"
        body: dict[str, Any] = answer.json()
        return body

    def ned(self) -> tuple[float, float, float]:
        position = self.ok(self.get("/telemetry/ned"))["info"]["position"]
        return position["x"], position["y"], position["z"]

    def status(self) -> dict[str, Any]:
        info: dict[str, Any] = self.ok(self.get("/telemetry/status"))["info"]
        return info

    def pass_time(self, seconds: float) -> None:
        """Wait; one in virtual time has a clock of its own."""
        time.sleep(seconds)

    @property
    def now(self) -> float:
        """The clock, s."""
        return time.monotonic()

    def until(self, look: Callable[[], Any], limit: float = TIMEOUT, what: str = "it") -> Any:
        """The first true value of `look`, which must come within so many s of the rig's clock."""
        deadline = self.now + limit
        while not (value := look()):
            assert self.now < deadline, f"{what} did not happen within {limit:g} s"
            self.pass_time(0.05)
        return value

    def speed_up(self, factor: float) -> None:
        """Have the embedded vehicle's clock run so many times as fast as ours."""
        assert self.control is not None
        self.control.ask("parameter", name="SIM_SPEEDUP", value=factor)

    @contextlib.contextmanager
    def slowly(self) -> Iterator[None]:
        """Meanwhile the vehicle's clock runs four times as fast as ours, not ten: a test sees more of a flight."""
        self.ok(self.get("/command/set_sim_speedup", sim_factor=4))
        try:
            yield
        finally:
            self.ok(self.get("/command/set_sim_speedup", sim_factor=SPEEDUP))

    def switch_mode(self, name: str) -> None:
        """The pilot changes the mode at MAVProxy's prompt."""
        self.mavproxy.type(f"mode {name}")

    def set(self, name: str, value: str) -> None:
        """Change a setting of the API."""
        self.mavproxy.type(f"uavapi set {name} {value}")
        self.mavproxy.ask(f"uavapi set {name}", f" {value} ")

    def wait_until_up(self, timeout: float = TIMEOUT) -> None:
        """Wait until the API knows its vehicle."""

        def up() -> bool:
            with contextlib.suppress(requests.ConnectionError, requests.Timeout):
                return requests.get(self.url + "/telemetry/status", timeout=5).status_code == 200
            if hasattr(self, "mavproxy"):  # else it runs in a terminal
                self.mavproxy.require_running()
            return False

        eventually(up, timeout, "the API's knowing its vehicle")

    def stay_armed(self) -> None:
        """Have ArduPilot's copter stay armed on the ground for longer than 10 s, which are 1 s here."""
        self.mavproxy.says("Received", timeout=60)  # the parameters, without which MAVProxy sets none
        self.mavproxy.type("param set DISARM_DELAY 120")

    def in_the_air(self, alt: float = 10) -> None:
        """Get it to `alt` m above home, in GUIDED, whatever it was doing."""
        status = self.status()
        if status["armed"] and status["landed_state"] != "on_ground":
            # What protects it comes to rest first.
            self.until(lambda: self.get("/command/guided").status_code == 200, 30, "its being free")
            x, y, _ = self.ned()
            self.ok(self.post("/movement/go_to_ned_wait", x=x, y=y, z=-alt))
            return
        self.ok(self.get("/command/disarm"))  # armed and forgotten on the ground it may disarm at any moment
        self._throttle(1000)
        self.ok(self.get("/command/arm"))
        self.ok(self.get("/command/takeoff", alt=alt))
        self._throttle(1500)

    def on_the_ground(self) -> None:
        """Get it down and disarmed."""
        self.ok(self.get("/command/land"))
        self._throttle(1000)

    def _throttle(self, pwm: int) -> None:
        """Move the pilot's throttle: low to arm; in the middle to fly, so that LOITER holds the height."""
        if self.control is not None:
            self.control.fault("pilot_sticks", throttle=pwm)

    def start(self, name: str, command: list[str], env: dict[str, str] | None = None) -> Process:
        process = Process(command, self.directory / f"{name}.log", self.directory, env)
        self.processes.append(process)
        return process

    def stop(self) -> None:
        if self.control is not None:
            self.control.close()
        for process in reversed(self.processes):
            process.stop()


def mavproxy_command(instance: int | Sequence[int], *arguments: str, logs: bool = False) -> list[str]:
    """MAVProxy on one or more simulated vehicles, with a prompt on its stdin.

    Args:
        instance: of the vehicle, or of each.
        arguments: further ones.
        logs: whether MAVProxy logs telemetry, the API its trail, and all standard modules are loaded, as its users
            have it; that takes more than half of MAVProxy's processor time.
    """
    instances = [instance] if isinstance(instance, int) else instance
    masters = [f"--master=tcp:127.0.0.1:{5760 + 10 * number}" for number in instances]
    lean = [] if logs else ["--no-state", f"--default-modules={FEW_MODULES}"]
    return [*MAVPROXY, *masters, "--retries=20", f"--streamrate={STREAM_RATE}", *lean, *arguments]


def load(port: int, **settings: Any) -> str:
    """The option that loads our module on that port; a setting of None is left out.

    The limits of silence are longer than the module's own: a machine that does much else may pause for seconds.
    """
    options = {"port": port, "link_timeout": SILENCE, "max_age": SILENCE, **settings}
    options = {name: value for name, value in options.items() if value is not None}
    return "--cmd=module load uavapi:" + json.dumps(options, separators=(",", ":"))


def start_embedded(rig: Rig, *arguments: str, speedup: float = SPEEDUP) -> int:
    """Start the embedded vehicle with its back door; the instance that it is."""
    instance, control = free_instance(), free_port()
    command = [sys.executable, "-m", "mavproxy_uavapi.sim", f"--instance={instance}", f"--home={HOME}"]
    vehicle = rig.start("sim", [*command, f"--speedup={speedup:g}", f"--control={control}", "--seed=1", *arguments])
    vehicle.says("listening on tcp")
    vehicle.says("control on tcp")
    rig.control = RemoteDoor(control)
    if not any(argument.startswith("--vehicle") for argument in arguments):
        for name, value in PARAMETERS.items():
            rig.control.ask("parameter", name=name, value=value)
    return instance


def embedded(directory: Path, *arguments: str, speedup: float = SPEEDUP, logs: bool = False, **settings: Any) -> Rig:
    """A rig with the embedded vehicle; `logs` is of `mavproxy_command`."""
    rig = Rig(directory, free_port())
    try:
        instance = start_embedded(rig, *arguments, speedup=speedup)
        rig.mavproxy = rig.start("mavproxy", mavproxy_command(instance, load(rig.port, **settings), logs=logs))
        rig.wait_until_up()
    except BaseException:
        rig.stop()
        raise
    return rig


def headless() -> dict[str, str]:
    """The environment in which sim_vehicle.py opens no window, and finds our MAVProxy."""
    env = {"PATH": f"{SCRIPTS}{os.pathsep}{os.environ['PATH']}"}
    return env | dict.fromkeys(("DISPLAY", "TMUX", "STY", "SITL_RITW_TERMINAL"), "")


def sim_vehicle(directory: Path, instance: int, *arguments: str, speedup: int = SPEEDUP) -> list[str]:
    """ArduPilot's own launcher with its copter."""
    script = Path(os.environ["ARDUPILOT_HOME"], "Tools", "autotest", "sim_vehicle.py")
    command = [sys.executable, str(script), "-v", "ArduCopter", "-N", "-w", f"-I{instance}"]
    return [*command, "--speedup", str(speedup), "-l", HOME, "--use-dir", str(directory), *arguments]


def ardupilot(directory: Path, *, speedup: int = SPEEDUP, **settings: Any) -> Rig:
    """A rig with ArduPilot's own copter, started as its users do: our module in sim_vehicle.py's MAVProxy."""
    rig = Rig(directory, free_port())
    config = directory / "uavapi.ini"
    options = {"port": rig.port, "link_timeout": SILENCE, "max_age": SILENCE, **settings}
    lines = [f"{name} = {value}\n" for name, value in options.items()]
    config.write_text("[api]\n" + "".join(lines), encoding="utf-8")
    module = f'--load-module=uavapi:{{"config":"{config}"}}'
    command = sim_vehicle(directory, free_instance(), "-m", module, speedup=speedup)
    try:
        rig.mavproxy = rig.start("sim_vehicle", command, headless())
        rig.wait_until_up(120)
        rig.stay_armed()
    except BaseException:
        rig.stop()
        raise
    return rig


def ardupilot_with_faults(directory: Path, *, speedup: int = SPEEDUP, **settings: Any) -> Rig:
    """A rig with ArduPilot's own copter behind a wire that records and misbehaves."""
    rig, instance = Rig(directory, free_port()), free_instance()
    command = sim_vehicle(directory, instance, "--no-mavproxy", speedup=speedup)
    try:
        rig.start("sim_vehicle", command, headless())
        rig.control, rig.is_ardupilot = Relay(5760 + 10 * instance), True
        master = f"--master=tcp:127.0.0.1:{rig.control.port}"
        rig.mavproxy = rig.start("mavproxy", [*MAVPROXY, master, "--retries=20", load(rig.port, **settings)])
        rig.wait_until_up(120)
        rig.stay_armed()
    except BaseException:
        rig.stop()
        raise
    return rig
