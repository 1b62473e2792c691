"""The embedded vehicle, a tap and MAVProxy as real processes: those of the end-to-end tests."""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tap import Tap

ROOT = Path(__file__).resolve().parent.parent


sys.path.insert(0, str(ROOT))  # for `tests.support`, whose processes these are

from tests.support import processes as harness  # noqa: E402
from tests.support.ports import free_port  # noqa: E402

# The harness gives each worker of pytest-xdist ports of its own: ours must not be those of a test run.
os.environ.setdefault("PYTEST_XDIST_WORKER", f"gw{10 + os.getpid() % 15}")


@contextlib.contextmanager
def rig(*, outs: tuple[str, ...] = (), streamrate: int = 4, **settings: Any) -> Iterator[tuple[Any, Tap]]:
    """The embedded vehicle, a tap, and a MAVProxy with our module behind it.

    Args:
        outs: MAVProxy's `--out` addresses.
        streamrate: Hz that MAVProxy asks for.
        settings: of our module.
    """
    with tempfile.TemporaryDirectory(prefix="uavapi-bench-") as directory:
        made = harness.Rig(Path(directory), free_port())
        tap = None
        try:
            instance = harness.start_embedded(made, speedup=1)
            tap = Tap(5760 + 10 * instance)
            command = [*harness.MAVPROXY, f"--master=tcp:127.0.0.1:{tap.port}", f"--streamrate={streamrate}"]
            command += [f"--out={out}" for out in outs]
            made.mavproxy = made.start("mavproxy", [*command, harness.load(made.port, **settings)])
            made.wait_until_up()
            yield made, tap
        finally:
            made.stop()
            if tap is not None:
                tap.close()


def fly(rig: Any, alt: float = 10.0) -> None:
    """Get it into the air, in GUIDED; its estimator settles at ten times the speed, the rest is at speed 1.

    Armed and on the ground it disarms after 10 s of its own, which a busy machine may need for a request.
    """
    rig.ok(rig.get("/command/set_sim_speedup", sim_factor=10))
    harness.eventually(lambda: rig.status()["ready_to_arm"], 120, "getting ready to arm")
    rig.ok(rig.get("/command/set_sim_speedup", sim_factor=1))
    rig.in_the_air(alt)
