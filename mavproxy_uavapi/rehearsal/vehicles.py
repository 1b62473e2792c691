"""The simulated vehicles of a rehearsal, as they were ordered."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from mavproxy_uavapi.launcher import instances
from mavproxy_uavapi.launcher.errors import OptionError
from mavproxy_uavapi.launcher.fleet import east_of
from mavproxy_uavapi.launcher.locations import resolve
from mavproxy_uavapi.launcher.options import RunOptions
from mavproxy_uavapi.rehearsal.order import Order
from mavproxy_uavapi.rehearsal.sitl import SitlVehicle
from mavproxy_uavapi.sim.options import Home, Options, Wind
from mavproxy_uavapi.sim.simulator import Simulator

STEP = 0.02  # s; flights differ by centimetres from those with 0.01
FIRST_SITL_INSTANCE = 1  # 0 has the ports that everybody tries


@contextmanager
def vehicles_of(order: Order, folder: Path) -> Iterator[Sequence[Simulator | SitlVehicle]]:
    """The vehicles, with system ids from 1 on, in a row to the east of the first one.

    Args:
        order: what they are.
        folder: where ArduPilot's SITL works, if they are that.

    Raises:
        OptionError: the place, the wind or a parameter cannot be read, or SITL is not built.
        LaunchError: SITL does not come up.
    """
    each = _options(order)
    if order.ardupilot is None:
        epoch = time.time()
        yield [Simulator(options, epoch) for options in each]
        return
    with ExitStack() as stack:
        vehicles = []
        for options in each:
            instance = stack.enter_context(instances.reserved(FIRST_SITL_INSTANCE))
            vehicles.append(SitlVehicle(options, order.ardupilot, folder, instance))
            stack.callback(vehicles[-1].end)
        yield vehicles


def _options(order: Order) -> list[Options]:
    home, spacing = resolve(order.location), RunOptions().spacing
    try:
        wind = Wind.parse(order.wind) if order.wind else Wind()
        defaults = () if order.parameters is None else _read(order.parameters.read_text(encoding="utf-8"))
    except ValueError as error:
        raise OptionError(str(error)) from error
    return [
        Options(
            vehicle=order.vehicle,
            sysid=number + 1,
            speedup=order.speedup,
            home=Home(*east_of(home, number * spacing)),
            seed=order.seed,
            wind=wind,
            gps_noise=order.gps_noise,
            battery=order.battery,
            defaults=defaults,
            step=STEP,
        )
        for number in range(order.count)
    ]


def _read(text: str) -> tuple[tuple[str, float], ...]:
    """Parameters, a NAME VALUE a line."""
    rows = [line.split() for line in text.splitlines()]
    return tuple((name, float(value)) for name, value in filter(None, rows))
