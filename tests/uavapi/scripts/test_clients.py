from __future__ import annotations

import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import pytest

from mavproxy_uavapi.scripts.clients import REHEARSED, is_rehearsed

CALLS = "import socket, sys; s = socket.create_connection(('127.0.0.1', int(sys.argv[1]))); s.recv(1)"


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server


def call(listener: socket.socket, words: list[str], **more: str) -> tuple[int, Any]:
    """The port of the one that calls, and the process that it is below."""
    own = str(listener.getsockname()[1])
    process = subprocess.Popen([*words, sys.executable, "-c", CALLS, own], env={**os.environ, **more})
    near, (_, port) = listener.accept()
    return port, (process, near)


@pytest.mark.parametrize("words", [[], ["sh", "-c", 'env -i "$@"; true', "sh"]])
def test_program_that_is_rehearsed_is_found_without_its_environment_too(
    listener: socket.socket, words: list[str]
) -> None:
    port, (process, near) = call(listener, words, **{REHEARSED: "/a", "UAVAPI_URL": "http://127.0.0.1:1"})
    try:
        assert is_rehearsed(port, listener.getsockname()[1])
        assert not is_rehearsed(port + 1, listener.getsockname()[1])
    finally:
        near.close()
        process.wait(60)


def test_program_that_is_not_rehearsed_may_call(listener: socket.socket) -> None:
    port, (process, near) = call(listener, [])
    try:
        assert not is_rehearsed(port, listener.getsockname()[1])
    finally:
        near.close()
        process.wait(60)
