"""What the push costs: CPU time of one update, and of a second of pushing one vehicle at 1 Hz.

The module's own code pushes a vehicle's position over a keep-alive connection to a station in another process.
CPU time is that of this process, which does nothing else; the same loop without a station is subtracted.
"""

from __future__ import annotations

import asyncio
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from pymavlink import mavutil

from mavproxy_gradys.net.addresses import station
from mavproxy_gradys.net.http_client import Client
from mavproxy_gradys.push.pusher import Pusher
from mavproxy_gradys.push.statistics import StationTally
from mavproxy_gradys.settings import GradysModuleSettings
from mavproxy_uavapi.core.host import Host

mavlink = mavutil.mavlink
SECONDS = 20.0
PERIOD = 0.1  # s; ten times the usual rate, so that the clock's grain does not matter
PORT = 18917
MESSAGES = {
    "heartbeat": {"type": mavlink.MAV_TYPE_QUADROTOR, "autopilot": mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA},
    "gps_raw_int": {"fix_type": 3},
    "sys_status": {"battery_remaining": 97},
    "vfr_hud": {"groundspeed": 1.25, "airspeed": 1.5, "heading": 270},
    "global_position_int": {"lat": -158400810, "lon": -479266420, "relative_alt": 20123},
}


def message(name: str, fields: dict[str, Any]) -> Any:
    """A message of vehicle 1 as it comes off the wire."""
    kind = getattr(mavlink, f"MAVLink_{name}_message")
    made = kind(**{field: fields.get(field, 0) for field in kind.fieldnames})
    made._header = mavlink.MAVLink_header(kind.id, srcSystem=1, srcComponent=1)
    return made


async def measure(host: Host, push: bool) -> tuple[float, int]:
    """CPU seconds of SECONDS, and the updates that were acknowledged."""
    where = station(f"127.0.0.1:{PORT}")
    settings = GradysModuleSettings({"period": PERIOD}).snapshot()
    tally = StationTally(where.url, random.random)
    task = None
    if push:
        pusher = Pusher(where, host, settings, tally, Client(settings.timeout))
        task = asyncio.get_running_loop().create_task(pusher.run())
    await asyncio.sleep(1.0)  # until the connection is up
    before, cpu = tally.total("acknowledged"), time.process_time()
    deadline = time.monotonic() + SECONDS
    while time.monotonic() < deadline:
        for name, fields in MESSAGES.items():
            host._receive(message(name, fields))
        await asyncio.sleep(0.25)
    used = time.process_time() - cpu
    if task is not None:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
    return used, tally.total("acknowledged") - before


async def compare() -> tuple[float, float, int]:
    """CPU seconds without and with the push, and the updates."""
    settings = SimpleNamespace(target_system=1, target_component=1, source_system=255, source_component=230)
    host = Host(SimpleNamespace(select_extra={}, settings=settings, master=lambda _=None: None))
    host.link_watch.watch = lambda state: None  # type: ignore[method-assign]
    idle, _ = await measure(host, push=False)
    busy, updates = await measure(host, push=True)
    return idle, busy, updates


def main() -> int:
    """Measure and print; 0 when one vehicle at 1 Hz costs less than 1 % of a core."""
    with tempfile.TemporaryDirectory() as name:
        command = [sys.executable, "-m", "mavproxy_gradys.station", f"--port={PORT}", "--watched"]
        command.append(f"--database={Path(name) / 'station.db'}")
        receiver = subprocess.Popen(command, stdout=subprocess.PIPE)
        assert receiver.stdout is not None
        receiver.stdout.readline()
        try:
            idle, busy, updates = asyncio.run(compare())
        finally:
            receiver.terminate()
            receiver.wait()
            receiver.stdout.close()
    each = (busy - idle) / max(updates, 1)
    print(f"{updates} updates in {SECONDS:g} s: {1000 * each:.2f} ms of CPU each")
    print(f"  one vehicle at 1 Hz: {100 * each:.2f} % of a core")
    return int(each >= 0.01)


if __name__ == "__main__":
    sys.exit(main())
