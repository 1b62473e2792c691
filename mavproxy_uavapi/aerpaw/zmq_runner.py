"""ZmqStateMachine: runners that change each other's states and query each other's values, through a proxy.

pyzmq is imported when a runner is bound to its proxy; other scripts do not need it.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from typing import Any

from mavproxy_uavapi.aerpaw import wire
from mavproxy_uavapi.aerpaw.constants import (
    ZMQ_PROXY_IN_PORT,
    ZMQ_PROXY_OUT_PORT,
    ZMQ_QUERY_FIELD_TIMEOUT_S,
    ZMQ_TYPE_FIELD_CALLBACK,
    ZMQ_TYPE_FIELD_REQUEST,
    ZMQ_TYPE_GOODBYE,
    ZMQ_TYPE_HELLO,
    ZMQ_TYPE_TRANSITION,
)
from mavproxy_uavapi.aerpaw.decorators import EXPOSED_FIELD, EXPOSED_STATE, STATE, background
from mavproxy_uavapi.aerpaw.exceptions import StateMachineError
from mavproxy_uavapi.aerpaw.runner import StateMachine, call
from mavproxy_uavapi.aerpaw.zmq_outbox import ZmqOutbox
from mavproxy_uavapi.aerpaw.zmq_proxy import check_zmq_proxy_reachable
from mavproxy_uavapi.core.timeout import wait_with_timeout

log = logging.getLogger("aerpawlib.v1.zmq")

SUBSCRIBE_TIMEOUT = 2.0  # s for the proxy to subscribe; messages that are published before are lost
HELLO_PERIOD = 0.05  # s between hellos to itself
LINGER = 500  # ms to send the last messages


class ZmqStateMachine(StateMachine):
    """A StateMachine that other runners address by its identifier."""

    _identifier: str | None = None
    _proxy = ""

    def _initialize_zmq_bindings(self, vehicle_identifier: str, proxy_server_addr: str) -> None:
        """Make it reachable under that identifier through that proxy.

        Raises:
            ConnectionError: there is no proxy.
            StateMachineError: pyzmq is not installed.
        """
        try:
            import zmq.asyncio  # noqa: PLC0415 - an extra
        except ImportError as error:
            raise StateMachineError("ZMQ runners need pyzmq: pip install 'mavproxy-uavapi[aerpaw]'") from error
        if not check_zmq_proxy_reachable(proxy_server_addr):
            raise ConnectionError(
                f"ZMQ proxy at {proxy_server_addr} is not reachable; start it before its runners: "
                "python -m mavproxy_uavapi.aerpaw.zmq_proxy"
            )
        self._zmq = zmq
        self._context = zmq.asyncio.Context()
        self._identifier, self._proxy = vehicle_identifier, proxy_server_addr
        self._outbox = ZmqOutbox(time.monotonic)
        self._hears_itself = asyncio.Event()
        self._queries: dict[tuple[str, str], list[asyncio.Future[Any]]] = {}  # by runner and field

    def _build(self) -> None:
        super()._build()
        self._fields = dict(self.marked(EXPOSED_FIELD))
        self._aliases: dict[str, str] = {}
        for name, method in self.marked(EXPOSED_STATE):
            mark = getattr(method, STATE, None)
            if mark is None:
                raise StateMachineError("@expose_zmq can only be used on @state/@timed_state methods")
            self._aliases[name] = mark.name

    async def run(self, vehicle: Any) -> None:
        """Run from the first state to the last.

        Raises:
            StateMachineError: it has no identifier and no proxy; see also `StateMachine.run`.
        """
        if self._identifier is None:
            raise StateMachineError(
                "ZMQ bindings not initialized: ZMQ runners need --zmq-identifier NAME --zmq-proxy-server ADDRESS"
            )
        try:
            await super().run(vehicle)
        finally:
            self._context.destroy(LINGER)

    # -- for scripts --------------------------------------------------------------------------------------

    async def transition_runner(self, identifier: str, state: str) -> None:
        """Make another runner change to a state when its present state ends."""
        self._send(ZMQ_TYPE_TRANSITION, identifier, next_state=state)

    async def query_field(self, identifier: str, field: str, timeout: float = ZMQ_QUERY_FIELD_TIMEOUT_S) -> Any:
        """A value of another runner.

        Raises:
            asyncio.TimeoutError: it did not answer within `timeout` s.
        """
        answer: asyncio.Future[Any] = asyncio.get_running_loop().create_future()
        waiting = self._queries.setdefault((identifier, field), [])
        waiting.append(answer)
        self._send(ZMQ_TYPE_FIELD_REQUEST, identifier, field=field)
        try:
            return await wait_with_timeout(timeout, answer)
        finally:
            waiting.remove(answer)

    def _send(self, kind: str, identifier: str | None = None, **members: Any) -> None:
        to = {} if identifier is None else {"identifier": identifier}
        self._outbox.put({"msg_type": kind, "from": self._identifier, **to, **members})

    # -- the network --------------------------------------------------------------------------------------

    @background
    async def _publish(self) -> None:
        # An XPUB socket is notified of its subscriber, the proxy, once it has a listener itself.
        publisher = self._context.socket(self._zmq.XPUB)
        publisher.linger = LINGER
        try:
            publisher.connect(f"tcp://{self._proxy}:{ZMQ_PROXY_IN_PORT}")
            await publisher.poll(SUBSCRIBE_TIMEOUT * 1000)
            with contextlib.suppress(asyncio.TimeoutError):
                await wait_with_timeout(SUBSCRIBE_TIMEOUT, self._hear_itself(publisher))
            await publisher.send(wire.written({"msg_type": ZMQ_TYPE_HELLO, "from": self._identifier}))
            while True:
                await publisher.send(wire.written(await self._outbox.next()))
        finally:
            for message in self._outbox.rest():
                publisher.send(wire.written(message))
            publisher.send(wire.written({"msg_type": ZMQ_TYPE_GOODBYE, "from": self._identifier}))
            publisher.close()

    async def _hear_itself(self, publisher: Any) -> None:
        """Wait until its own messages arrive: then it misses no answer to its hello."""
        to_itself = {"msg_type": ZMQ_TYPE_HELLO, "from": self._identifier, "identifier": self._identifier}
        while not self._hears_itself.is_set():
            await publisher.send(wire.written(to_itself))
            await asyncio.sleep(HELLO_PERIOD)

    @background
    async def _subscribe(self, vehicle: Any) -> None:
        subscriber = self._context.socket(self._zmq.SUB)
        answers: set[asyncio.Task[None]] = set()
        try:
            subscriber.setsockopt(self._zmq.SUBSCRIBE, b"")
            subscriber.connect(f"tcp://{self._proxy}:{ZMQ_PROXY_OUT_PORT}")
            while True:
                try:
                    message = wire.read(await subscriber.recv(), type(self).__module__)
                except ValueError as error:
                    log.warning("a message was ignored: %s", error)
                    continue
                if self._is_for_me(message):
                    answer = asyncio.create_task(self._take(message, vehicle))
                    answers.add(answer)
                    answer.add_done_callback(answers.discard)
        finally:
            subscriber.close(0)

    def _is_for_me(self, message: dict[str, Any]) -> bool:
        """Whether a message is to be answered; notes who is there."""
        kind, sender = message.get("msg_type"), str(message.get("from"))
        if sender == self._identifier:
            self._hears_itself.set()
        else:
            self._outbox.heard(sender, joins=kind == ZMQ_TYPE_HELLO)
        return message.get("identifier") == self._identifier and kind != ZMQ_TYPE_HELLO

    async def _take(self, message: dict[str, Any], vehicle: Any) -> None:
        kind, sender, field = message.get("msg_type"), str(message.get("from")), str(message.get("field"))
        if kind == ZMQ_TYPE_TRANSITION:
            state = str(message.get("next_state"))
            log.info("%s requests state %s", sender, state)
            self._overrides.append(self._aliases.get(state, state))
        elif kind == ZMQ_TYPE_FIELD_REQUEST:
            self._send(ZMQ_TYPE_FIELD_CALLBACK, sender, field=field, value=await self._value(field, vehicle))
        elif kind == ZMQ_TYPE_FIELD_CALLBACK:
            for answer in self._queries.get((sender, field), []):
                if not answer.done():
                    answer.set_result(message.get("value"))
        else:
            log.warning("a message of %s was ignored: its type is %r", sender, kind)

    async def _value(self, field: str, vehicle: Any) -> Any:
        if field not in self._fields:
            log.warning("there is no field %s", field)
            return None
        try:
            return await call(self._fields[field], vehicle)
        except Exception:
            log.exception("the value of %s failed", field)
            return None
