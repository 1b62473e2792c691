"""Links that are slow, and a main loop of MAVProxy's that stands; for `World`."""

from __future__ import annotations

import asyncio
import random
from collections.abc import Callable
from typing import Any

from tests.support.world import Sent, World


def delay(world: World, seconds: float, jitter: float = 0.0, seed: int = 1) -> None:
    """Each message takes so many s, and up to `jitter` s more by chance: then some are overtaken."""
    feed, chance = world.host.bridge.feed, random.Random(seed)

    def lag() -> float:
        return seconds + chance.uniform(0.0, jitter)

    async def send(message: Any, _system: int) -> None:
        await asyncio.sleep(0)
        world.sent.append(Sent(world.loop.time(), world._as_on_the_wire(message)))
        world.loop.call_later(lag(), lambda: world._arriving.append(message))

    def arrive(message: Any) -> None:
        feed(message)
        world.host.bridge.turn()

    world.send = send
    world.host.bridge.feed = lambda message: world.loop.call_later(lag(), arrive, message)


def lose(world: World, seed: int = 1) -> Callable[[float], None]:
    """Lets a share of the messages be lost each way; it returns what sets the share, 0 before."""
    hears, chance, share = world.hears, random.Random(seed), 0.0
    send = world.send

    async def send_some(message: Any, system: int) -> None:
        if chance.random() >= share:
            await send(message, system)
        else:
            await asyncio.sleep(0)
            world.sent.append(Sent(world.loop.time(), world._as_on_the_wire(message)))

    def set_share(of_all: float) -> None:
        nonlocal share
        share = of_all

    world.send = send_some
    world.hears = lambda message: hears(message) and chance.random() >= share
    return set_share


def overtaking(world: World, seconds: float) -> Callable[[float], None]:
    """Each message takes so many s.

    Returns:
        Lets what is sent from now on take so many s more, so that what is sent later overtakes it.
    """
    delay(world, seconds)
    quick, more = world.send, 0.0

    async def send(message: Any, system: int) -> None:
        late = more
        if not late:
            await quick(message, system)
            return
        await asyncio.sleep(0)
        world.sent.append(Sent(world.loop.time(), world._as_on_the_wire(message)))
        world.loop.call_later(seconds + late, lambda: world._arriving.append(message))

    def hold_up(by: float) -> None:
        nonlocal more
        more = by

    world.send = send
    return hold_up


def standing(world: World, at_once: int = 1000) -> Callable[[bool], None]:
    """Let what is sent go through the bridge, as MAVProxy's own link does; call it before `go_live`.

    Args:
        world: the world.
        at_once: how many messages MAVProxy reads in a turn, as one datagram after the other.

    Returns:
        Lets MAVProxy's main loop stand still (True) or go on. What the vehicle says meanwhile waits on the link.
    """
    stands = False

    def stand(whether: bool) -> None:
        nonlocal stands
        stands = whether

    def write(message: Any) -> None:
        world.sent.append(Sent(world.loop.time(), world._as_on_the_wire(message)))
        world._arriving.append(message)

    async def send(message: Any, _system: int) -> None:
        await world.host.bridge.on_main(lambda: write(message))

    unread: list[Any] = []

    def read(messages: list[Any]) -> None:
        unread.extend(messages)
        if stands:
            return
        world.host.bridge.turn()  # the idle task comes before select()
        now, unread[:] = unread[:at_once], unread[at_once:]
        for message in now:
            world.host.bridge.feed(message)
        world.host.bridge.turn()

    world.host.bridge.links_have_unread = lambda: bool(unread)
    world.send, world._read = send, read
    return stand
