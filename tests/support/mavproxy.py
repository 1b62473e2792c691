"""What our modules touch of MAVProxy: its state, its links, its main loop."""

from __future__ import annotations

import selectors
import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any


class FakeMaster:
    """One of MAVProxy's links: remembers what is written to it."""

    def __init__(self) -> None:
        self.written: list[Any] = []
        self.address = "127.0.0.1:14560"
        self.mav = SimpleNamespace(send=self.written.append)


def mavproxy_state() -> SimpleNamespace:
    """What our modules touch of MAVProxy's `mpstate`."""
    master = FakeMaster()
    return SimpleNamespace(
        select_extra={},
        command_map={},
        completions={},
        completion_functions={"(OTHER)": len},
        multi_instance={},
        instance_count={},
        public_modules={},
        settings=SimpleNamespace(
            target_system=0,
            target_component=0,
            source_system=255,
            source_component=230,
            streamrate=4,
            streamrate2=4,
        ),
        status=SimpleNamespace(logdir=None),
        rl=SimpleNamespace(prompt="MAV> "),
        continue_mode=False,
        mav_param_by_sysid={},
        mav_master=[master],
        mav_outputs=[SimpleNamespace(address="127.0.0.1:12345"), SimpleNamespace(address="/dev/ttyUSB1")],
        the_master=master,
        master=lambda system=None: master,
    )


class MainLoop:
    """MAVProxy's main loop, turned by hand: `select()` over select_extra, then the modules' idle tasks."""

    def __init__(self, mpstate: SimpleNamespace) -> None:
        self._mpstate = mpstate
        self.modules: list[Any] = []

    def turn(self, wait: float = 0.0) -> None:
        """One turn; wakes early when one of our descriptors does."""
        with selectors.DefaultSelector() as selector:
            for fd in self._mpstate.select_extra:
                selector.register(fd, selectors.EVENT_READ)
            ready = [key.fd for key, _ in selector.select(wait)] if selector.get_map() else []
        for fd in ready:
            function, argument = self._mpstate.select_extra[fd]
            function(argument)
        for module in self.modules:
            module.idle_task()

    def until(self, condition: Callable[[], Any], seconds: float = 60.0) -> None:
        """Turn until that holds."""
        deadline = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < deadline, "it did not happen"
            self.turn(0.01)
