"""`aerpawlib.v1.runner`: the runners, their decorators, and helpers."""

import asyncio

from mavproxy_uavapi.aerpaw.decorators import (
    at_init,
    background,
    entrypoint,
    expose_field_zmq,
    expose_zmq,
    state,
    timed_state,
)
from mavproxy_uavapi.aerpaw.runner import BasicRunner, Runner, StateMachine
from mavproxy_uavapi.aerpaw.zmq_runner import ZmqStateMachine

in_background = asyncio.ensure_future
sleep = asyncio.sleep

__all__ = [
    "BasicRunner",
    "Runner",
    "StateMachine",
    "ZmqStateMachine",
    "at_init",
    "background",
    "entrypoint",
    "expose_field_zmq",
    "expose_zmq",
    "in_background",
    "sleep",
    "state",
    "timed_state",
]
