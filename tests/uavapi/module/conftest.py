from __future__ import annotations

import re
import threading
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from mavproxy_uavapi.module import UavApiModule
from tests.support.mavproxy import MainLoop
from tests.support.messages import message_of
from tests.support.module_loader import Loader, ask
from tests.support.ports import free_port


@pytest.fixture
def loader(mpstate: SimpleNamespace, main_loop: MainLoop) -> Iterator[Loader]:
    loader = Loader(mpstate, main_loop)
    yield loader
    for module in list(main_loop.modules):
        loader.unload(module)


@pytest.fixture
def port() -> int:
    return free_port()


@pytest.fixture
def module(loader: Loader, port: int, output: Callable[[str], str]) -> UavApiModule:
    """The module, listening."""
    module = loader.load(port=port)
    assert output("listening") == f"uavapi: listening on http://127.0.0.1:{port}\n"
    return module


@pytest.fixture
def output(main_loop: MainLoop, capsys: pytest.CaptureFixture[str]) -> Callable[[str], str]:
    """Turn the main loop until those words were printed; everything that was printed since the last time.

    How long the loop stood on a busy machine is left out.
    """

    def output(words: str) -> str:
        printed: list[str] = []

        def was_printed() -> bool:
            printed.append(capsys.readouterr().out)
            return words in "".join(printed)

        main_loop.until(was_printed)
        return re.sub(r".* main loop stood for .* s\n", "", "".join(printed))

    return output


@pytest.fixture
def arming(module: UavApiModule, main_loop: MainLoop, port: int) -> Callable[[], Any]:
    """A call in flight, which arms a vehicle that does not get ready; waits for its answer: status and body."""
    answers: list[Any] = []
    module.mavlink_packet(message_of("heartbeat"))
    main_loop.until(lambda: 1 in module.host.fleet.vehicles)
    client = threading.Thread(target=lambda: answers.append(ask(port, "/command/arm")))
    client.start()
    main_loop.until(module.host.jobs.running)

    def answer() -> Any:
        client.join(60.0)
        return answers[0]

    return answer
