"""What `gradys set hear` costs: the share of a core that the positions of others take.

A real Mosquitto; another process publishes one position a second of each vehicle of others. All of them and all of
ours fly in one square, so near that no vehicle can be passed over because it is far away.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import multiprocessing
import random
import sys
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from figures import machine, table
from paho.mqtt import client as mqtt
from paho.mqtt.enums import CallbackAPIVersion

from mavproxy_gradys.nearby.listener import PositionListener
from tests.support.fleet import Broker
from tests.support.messages import message_of

SIDE = 0.02  # degrees of the square, 2 km
HOME = -35.363261, 149.165230  # degrees
REST = 2.0  # s until all is connected


def publish(port: int, count: int, seconds: float) -> None:
    """Publish positions of `count` vehicles, once a second each, evenly."""
    client = mqtt.Client(CallbackAPIVersion.VERSION2)
    client.connect("127.0.0.1", port)
    client.loop_start()
    chance, began = random.Random(1), time.monotonic()
    homes = [[home + chance.random() * SIDE for home in HOME] for _ in range(count)]
    for number in range(int(count * seconds)):
        time.sleep(max(began + number / count - time.monotonic(), 0.0))
        north, east = homes[number % count]
        place = [north + 1e-4 * (number // count), east, 20.0]  # 11 m/s to the north
        reading = {"device": f"other-{number % count}", "id": "1", "seq": number, "quantity": "position"}
        body = {**reading, "representation": "degrees", "value": place, "time": round(time.time(), 3)}
        client.publish(f"fleet/other-{number % count}/position", json.dumps(body))
    client.loop_stop()


class Always:
    """A message that has just arrived."""

    def __init__(self, message: Any) -> None:
        self.message = message

    @property
    def at(self) -> float:
        """Now, s."""
        return time.monotonic()


def host(ours: int, separation: float, said: list[str]) -> Any:
    """A host with vehicles in the air, each at 10 m/s; their positions are always new."""
    chance, states = random.Random(2), {}
    for system in range(1, ours + 1):
        lat, lon = (int(1e7 * (home + chance.random() * SIDE)) for home in HOME)
        message = message_of("global_position_int", lat=lat, lon=lon, vx=1000)
        messages = {"GLOBAL_POSITION_INT": Always(message)}
        states[system] = SimpleNamespace(system=system, armed=True, landed=False, messages=messages)
    registry = SimpleNamespace(traffic=SimpleNamespace(separation=separation))
    fleet = SimpleNamespace(vehicles=states)
    return SimpleNamespace(clock=time.monotonic, registry=registry, fleet=fleet, warn=said.append)


async def measure(port: int, ours: int, separation: float, seconds: float) -> tuple[float, int]:
    """The share of a core (%), and the number of warnings."""
    said: list[str] = []
    listening = asyncio.ensure_future(
        PositionListener(host(ours, separation, said), f"mqtt://127.0.0.1:{port}", 5.0, "").run()
    )
    await asyncio.sleep(REST)
    began, used = time.monotonic(), time.process_time()
    await asyncio.sleep(seconds)
    share = 100 * (time.process_time() - used) / (time.monotonic() - began)
    listening.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await listening
    return share, len(said)


def main() -> int:
    """Measure, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--others", type=int, default=1000, help="vehicles of others (%(default)s)")
    parser.add_argument("--ours", type=int, default=50, help="our vehicles in the air (%(default)s)")
    parser.add_argument("--seconds", type=float, default=20.0, help="of each row (%(default)g)")
    options = parser.parse_args()
    print(f"bench_nearby: {machine()}")
    rows = []
    with tempfile.TemporaryDirectory(prefix="uavapi-nearby-") as name:
        broker = Broker(Path(name))
        broker.start()
        try:
            for separation in (0.0, 8.0, 50.0):
                longer = options.seconds + 2 * REST
                other = multiprocessing.Process(target=publish, args=(broker.port, options.others, longer))
                other.start()
                share, said = asyncio.run(measure(broker.port, options.ours, separation, options.seconds))
                other.join()
                rows.append([f"{separation:g}", str(options.others), str(options.ours), f"{share:.1f}", str(said)])
        finally:
            broker.stop()
    print(table(["separation m", "others", "ours", "% of a core", "warnings"], rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
