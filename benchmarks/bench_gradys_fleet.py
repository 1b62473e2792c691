"""A hundred vehicles at 1 Hz through one Mosquitto, and the CPU time of all processes that takes.

One process tells the telemetry of all vehicles (heartbeat, fix, status, speeds and position, each once a second,
over UDP); one real MAVProxy hears them and publishes every position with QoS 1, each vehicle on a connection
with a last will of its own; one Mosquitto on this machine; this process subscribes.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import shutil
import socket
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

from rig import harness

from tests.support.ports import free_port

MOSQUITTO = shutil.which("mosquitto", path="/usr/sbin:/usr/bin:/usr/local/sbin")
TICKS = os.sysconf("SC_CLK_TCK")


def generate(port: int, vehicles: int) -> None:
    """Tell the telemetry of the vehicles, spread over each second, until killed."""
    os.environ["MAVLINK20"] = "1"
    from pymavlink.dialects.v20 import ardupilotmega as mavlink  # noqa: PLC0415  only the child needs it

    out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    speakers = [mavlink.MAVLink(None, srcSystem=number + 1, srcComponent=1) for number in range(vehicles)]
    began = time.monotonic()
    turn = 0
    while True:
        second, number = divmod(turn, vehicles)
        time.sleep(max(0.0, began + turn / vehicles - time.monotonic()))
        turn += 1
        boot, lat = 1000 * second, round(-35.36e7 + 1e4 * number + 1e3 * math.sin(second / 10))
        flags = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        reported = [
            mavlink.MAVLink_heartbeat_message(2, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, flags, 0, 3, 3),
            mavlink.MAVLink_gps_raw_int_message(boot * 1000, 3, lat, 1491652300, 584000, 121, 200, 0, 0, 10),
            mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 12600, 0, 97, 0, 0, 0, 0, 0, 0),
            mavlink.MAVLink_vfr_hud_message(1.5, 1.25, 270, 0, 604.0, 0.0),
            mavlink.MAVLink_global_position_int_message(boot, lat, 1491652300, 604000, 20000, 0, 0, 0, 27000),
        ]
        packets = b"".join(message.pack(speakers[number]) for message in reported)
        try:
            out.sendto(packets, ("127.0.0.1", port))
        except ConnectionRefusedError:
            time.sleep(0.1)  # MAVProxy is not there yet


class Listener:
    """Subscribes to the fleet; counts by vehicle, and remembers numbers."""

    def __init__(self, port: int) -> None:
        from paho.mqtt import client as mqtt  # noqa: PLC0415  an extra

        self.numbers: list[int] = []
        self.delays: list[float] = []
        self.vehicles: set[str] = set()
        self._ready = threading.Event()
        self._client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
        self._client.on_message = self._take
        self._client.on_connect = lambda *_: self._client.subscribe("fleet/+/position", qos=1)
        self._client.on_subscribe = lambda *_: self._ready.set()
        self._client.connect("127.0.0.1", port)
        self._client.loop_start()
        assert self._ready.wait(10)

    def _take(self, _client: Any, _data: Any, message: Any) -> None:
        reading = json.loads(message.payload)
        self.numbers.append(reading["seq"])
        self.delays.append(time.time() - reading["time"])
        self.vehicles.add(reading["id"])

    def stop(self) -> None:
        """Leave."""
        self._client.disconnect()
        self._client.loop_stop()


def cpu(pid: int) -> float:
    """CPU seconds that a process has used, all its threads together."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def main() -> int:
    """Run it; 0 when every vehicle was heard at 1 Hz."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--vehicles", type=int, default=100)
    arguments.add_argument("--seconds", type=float, default=30.0)
    arguments.add_argument("--generate", type=int, help=argparse.SUPPRESS)
    options = arguments.parse_args()
    if options.generate:
        generate(options.generate, options.vehicles)
    if MOSQUITTO is None:
        print("fleet: Mosquitto is not installed (apt install mosquitto)")
        return 0
    with tempfile.TemporaryDirectory() as name:
        return run(harness, Path(name), options.vehicles, options.seconds)


def run(tools: Any, directory: Path, vehicles: int, seconds: float) -> int:
    """Measure for so many seconds."""
    rig = tools.Rig(directory, free_port())
    try:
        broker_port, link = free_port(), free_port()
        config = directory / "mosquitto.conf"
        config.write_text(f"listener {broker_port} 127.0.0.1\nallow_anonymous true\n", encoding="ascii")
        broker = rig.start("mosquitto", [str(MOSQUITTO), "-c", str(config)])
        settings = {"sink": f"mqtt://127.0.0.1:{broker_port}/fleet/{{device}}/{{quantity}}"}
        settings["spool"] = f"{directory}/spool.db"
        load = "--cmd=module load gradys:" + json.dumps(settings, separators=(",", ":"))
        mavproxy = rig.start("mavproxy", [*tools.MAVPROXY, f"--master=udp:127.0.0.1:{link}", load])
        mavproxy.says("Loaded module gradys", timeout=60)
        teller = rig.start("fleet", [sys.executable, __file__, f"--vehicles={vehicles}", f"--generate={link}"])
        listener = Listener(broker_port)
        tools.eventually(lambda: len(listener.vehicles) == vehicles, 60, "every vehicle's being heard")
        time.sleep(5.0)
        processes = {"MAVProxy": mavproxy.pid, "Mosquitto": broker.pid, "telemetry of all vehicles": teller.pid}
        before, count = {name: cpu(pid) for name, pid in processes.items()}, len(listener.numbers)
        time.sleep(seconds)
        used = {name: cpu(pid) - before[name] for name, pid in processes.items()}
        heard = len(listener.numbers) - count
        delays = sorted(listener.delays[count:])
        listener.stop()
    finally:
        rig.stop()
    print(f"{vehicles} vehicles at 1 Hz for {seconds:g} s: {heard} positions heard, {heard / seconds:.1f} a second")
    print(
        f"  measured to heard: median {delays[len(delays) // 2]:.2f} s, p99 {delays[int(0.99 * len(delays))]:.2f} s"
    )
    shares = {name: 100 * spent / seconds for name, spent in used.items()}
    print("  CPU: " + ", ".join(f"{name} {share:.1f} %" for name, share in shares.items()), end="")
    print(f"; together {sum(shares.values()):.1f} % of a core")
    return int(heard < 0.97 * vehicles * seconds)


if __name__ == "__main__":
    sys.exit(main())
