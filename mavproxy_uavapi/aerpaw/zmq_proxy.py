"""The proxy between runners: `python -m mavproxy_uavapi.aerpaw.zmq_proxy [--host ADDRESS]`."""

from __future__ import annotations

import argparse
import contextlib
import socket
import sys
from collections.abc import Sequence

from mavproxy_uavapi.aerpaw.constants import ZMQ_PROXY_CHECK_TIMEOUT_S, ZMQ_PROXY_IN_PORT, ZMQ_PROXY_OUT_PORT
from mavproxy_uavapi.core.terminal import say


def run_zmq_proxy(
    in_port: int | str = ZMQ_PROXY_IN_PORT, out_port: int | str = ZMQ_PROXY_OUT_PORT, host: str = "127.0.0.1"
) -> None:
    """Forward messages that runners publish to `in_port` to all listeners at `out_port`, until Ctrl-C.

    Everybody who reaches the ports can change the states of runners, so the default `host` is this machine.
    """
    import zmq  # noqa: PLC0415 - an extra

    with zmq.Context() as context, context.socket(zmq.XSUB) as inward, context.socket(zmq.XPUB) as outward:
        inward.bind(f"tcp://{host}:{in_port}")
        outward.bind(f"tcp://{host}:{out_port}")
        say(f"runners publish to {host}:{in_port} and listen at {host}:{out_port}")
        with contextlib.suppress(KeyboardInterrupt):
            zmq.proxy(inward, outward)
        inward.linger = outward.linger = 0


def check_zmq_proxy_reachable(proxy_addr: str, timeout_s: float = ZMQ_PROXY_CHECK_TIMEOUT_S) -> bool:
    """Whether a proxy listens at that address."""
    try:
        with socket.create_connection((proxy_addr, int(ZMQ_PROXY_OUT_PORT)), timeout=timeout_s):
            return True
    except OSError:
        return False


def main(arguments: Sequence[str] | None = None) -> None:
    """The command."""
    parser = argparse.ArgumentParser(prog="python -m mavproxy_uavapi.aerpaw.zmq_proxy", description=__doc__)
    parser.add_argument("--host", default="127.0.0.1", help="the address to listen at; 0.0.0.0 for all (%(default)s)")
    try:
        run_zmq_proxy(host=parser.parse_args(arguments).host)
    except ImportError:
        sys.exit("the proxy needs pyzmq: pip install 'mavproxy-uavapi[aerpaw]'")


if __name__ == "__main__":
    main()
