"""The other way, as a prototype: HTTP in a process of its own, which a MAVProxy module starts.

`module load http_apart:{"port":8000}`. MAVProxy's main loop writes the newest position, encoded, into shared memory;
the process answers reads from there. It validates a velocity and hands it over by a socket pair, which MAVProxy's
select loop reads. Nothing of what uavapi decides is here: no authority, no envelope, no rates, no jobs, no strangers.
So its figures are the best that the other way can reach.
"""

from __future__ import annotations

import asyncio
import json
import math
import mmap
import os
import socket
import struct
import subprocess
import sys
import time
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

SIZE = 4096
HEAD = struct.Struct("<QdI")  # a number that is odd while the rest is written, monotonic s, bytes
VELOCITY = struct.Struct("<3d")  # m/s NED
VELOCITY_ONLY = 0b110111000111  # type mask


class Newest:
    """One encoded message in a shared file in memory; one process writes, another reads."""

    def __init__(self, file: int) -> None:
        self._memory = mmap.mmap(file, SIZE)
        self._number = 0

    def write(self, content: bytes) -> None:
        """Replace it."""
        memory = self._memory
        HEAD.pack_into(memory, 0, self._number + 1, time.monotonic(), len(content))
        memory[HEAD.size : HEAD.size + len(content)] = content
        self._number += 2
        struct.pack_into("<Q", memory, 0, self._number)

    def read(self) -> tuple[float, bytes]:
        """When it was written (monotonic s), and it."""
        memory = self._memory
        while True:
            number, at, length = HEAD.unpack_from(memory)
            content = memory[HEAD.size : HEAD.size + length]
            if number % 2 == 0 and HEAD.unpack_from(memory)[0] == number:
                return at, content


def init(mpstate: Any, port: int) -> Any:
    """MAVProxy's entry point."""
    from MAVProxy.modules.lib import mp_module  # noqa: PLC0415  the process apart has no use for it

    class Module(mp_module.MPModule):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__(mpstate, "http_apart", "HTTP in a process of its own", public=True)
            memory = os.memfd_create("telemetry")
            os.ftruncate(memory, SIZE)
            self._newest = Newest(memory)
            self._commands, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
            shared = memory, theirs.fileno()
            self._child = subprocess.Popen([sys.executable, __file__, *map(str, (port, *shared))], pass_fds=shared)
            theirs.close()
            os.close(memory)
            mpstate.select_extra[self._commands.fileno()] = (self._fly, None)

        def mavlink_packet(self, message: Any) -> None:
            if message.get_type() == "GLOBAL_POSITION_INT":
                position = {"lat": message.lat / 1e7, "lon": message.lon / 1e7, "alt": message.alt / 1e3}
                velocity = {"vx": message.vx / 100, "vy": message.vy / 100, "vz": message.vz / 100}
                info = {"position": position, "velocity": velocity, "heading": message.hdg / 100}
                body = {"device": "uav", "id": "1", "result": "success", "info": info}
                self._newest.write(json.dumps(body).encode()[:-1])

        def _fly(self, _: Any) -> None:
            velocity = VELOCITY.unpack(self._commands.recv(VELOCITY.size))
            target = 0, self.target_system, 1, mavlink.MAV_FRAME_LOCAL_NED, VELOCITY_ONLY
            self.master.mav.set_position_target_local_ned_send(*target, 0, 0, 0, *velocity, 0, 0, 0, 0, 0)

        def unload(self) -> None:
            del mpstate.select_extra[self._commands.fileno()]
            self._child.terminate()
            self._child.wait()
            self._commands.close()
            super().unload()

    return Module()


async def serve(port: int, memory: int, commands: int) -> None:
    """The process apart, until it is terminated."""
    from aiohttp import web  # noqa: PLC0415  MAVProxy's process has no use for it

    from mavproxy_uavapi.http.wire.connection import Connection, headers_are_here  # noqa: PLC0415

    newest, bridge = Newest(memory), socket.socket(fileno=commands)
    head = b"HTTP/1.1 200 OK\r\nContent-Type: application/json; charset=utf-8\r\nContent-Length: %d\r\n\r\n%b"

    def position() -> bytes:
        at, content = newest.read()
        return content + b', "age": %.3f}' % (time.monotonic() - at)

    def again() -> bytes:
        body = position()
        return head % (len(body), body)

    async def answer(request: web.BaseRequest) -> web.StreamResponse:
        connection = Connection.of(request)
        if request.path == "/telemetry/gps" and connection is not None:
            connection.remember(again)
            return web.Response(body=position(), content_type="application/json")
        target = await request.json()
        velocity = [float(target[axis]) for axis in ("vx", "vy", "vz")]
        if not all(map(math.isfinite, velocity)):
            return web.Response(status=422)
        bridge.send(VELOCITY.pack(*velocity))
        return web.json_response({"device": "uav", "id": "1", "result": "sent"})

    server = web.Server(lambda request: headers_are_here(request, answer), access_log=None)
    loop = asyncio.get_running_loop()
    listening = await loop.create_server(lambda: Connection(server), "127.0.0.1", port)
    await listening.serve_forever()


if __name__ == "__main__":
    asyncio.run(serve(*map(int, sys.argv[1:])))
