"""The module as MAVProxy loads it, and a client of its API."""

from __future__ import annotations

import json
import socket
import threading
import urllib.error
import urllib.request
from types import SimpleNamespace
from typing import Any

import uavapi


class Loader:
    """Loads and unloads the module as MAVProxy does."""

    def __init__(self, mpstate: SimpleNamespace, main_loop: Any) -> None:
        self.mpstate, self.main_loop = mpstate, main_loop

    def load(self, **kwargs: Any) -> Any:
        module = uavapi.init(self.mpstate, **kwargs)
        self.main_loop.modules.append(module)
        return module

    def unload(self, module: Any) -> None:
        """In another thread, while the main loop waits."""
        thread = threading.Thread(target=module.unload)
        thread.start()
        thread.join(60.0)
        assert not thread.is_alive()
        self.main_loop.modules.remove(module)


def ask(port: int, path: str, **options: Any) -> tuple[int, Any]:
    """The status and body of an answer; `options` go to `urllib.request.Request`."""
    request = urllib.request.Request(f"http://127.0.0.1:{port}{path}", **options)
    try:
        with urllib.request.urlopen(request, timeout=60) as response:
            return response.status, json.load(response)
    except urllib.error.HTTPError as error:
        with error:
            return error.code, json.load(error)


def send_json(port: int, method: str, path: str, body: Any) -> tuple[int, Any]:
    """The status and body of the answer to a JSON body."""
    headers = {"Content-Type": "application/json"}
    return ask(port, path, data=json.dumps(body).encode(), headers=headers, method=method)


def listens(port: int) -> bool:
    with socket.socket() as client:
        return client.connect_ex(("127.0.0.1", port)) == 0
