"""The embedded vehicle's back door: its truth, what it got, and its faults; see `mavproxy_uavapi.sim.control`."""

from __future__ import annotations

import json
import socket
from collections.abc import Callable
from typing import Any


class BackDoor:
    """Asks by a function that answers a line with a line, such as `Control.handle_line`."""

    def __init__(self, answer_line: Callable[[str], str]) -> None:
        self._answer_line = answer_line

    def answer(self, op: str, **arguments: Any) -> dict[str, Any]:
        """What an operation is answered, which may be a refusal."""
        answer: dict[str, Any] = json.loads(self._answer_line(json.dumps({"op": op, **arguments})))
        return answer

    def ask(self, op: str, **arguments: Any) -> dict[str, Any]:
        """One operation, which must be done."""
        answer = self.answer(op, **arguments)
        assert answer["ok"], answer
        return answer

    def fault(self, name: str, **arguments: Any) -> None:
        """Make it misbehave."""
        self.ask("fault", name=name, **arguments)

    def close(self) -> None:
        """End what it asks by."""


class RemoteDoor(BackDoor):
    """That of another process, at a port of its own."""

    def __init__(self, port: int) -> None:
        super().__init__(self._exchange)
        self._socket = socket.create_connection(("127.0.0.1", port), timeout=10)
        self._lines = self._socket.makefile("rw", encoding="utf-8")

    def _exchange(self, line: str) -> str:
        self._lines.write(line + "\n")
        self._lines.flush()
        return self._lines.readline()

    def close(self) -> None:
        self._lines.close()
        self._socket.close()
