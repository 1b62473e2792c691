"""There is one way to a vehicle: nobody has its link but the rooms that send by a right, or ask."""

from __future__ import annotations

import ast

from tests.support.sources import trees

SIMULATOR = "mavproxy_uavapi/sim/"
# Who holds the link or the sender of a vehicle, and why.
HOLDERS = {
    "mavproxy_uavapi/core/control/command.py": "the right to command",
    "mavproxy_uavapi/core/vehicle/base.py": "it makes them, and asks questions",
    "mavproxy_uavapi/core/airspace/guard.py": "the guard before the link",
    "mavproxy_uavapi/core/link/link.py": "the link itself",
    "mavproxy_uavapi/core/link/command_sender.py": "acknowledgements",
    "mavproxy_uavapi/core/link/parameters.py": "a transfer",
    "mavproxy_uavapi/core/link/dataflash.py": "a transfer",
    "mavproxy_uavapi/core/mission/list_transfers.py": "a transfer",
    "mavproxy_uavapi/core/vehicle/registry.py": "it gives each vehicle the link",
    "mavproxy_uavapi/core/host.py": "it makes the link, and sends the closing messages",
}
PRIVATE = {"_link", "_sender", "_mavproxy_link"}


def users_of(tree: ast.AST) -> set[str]:
    """The private ways out that a file uses."""
    return {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute) and node.attr in PRIVATE}


def senders(tree: ast.AST) -> list[str]:
    """Calls of `something.link.send`, and of MAVLink's own `*_send`."""
    calls = [ast.unparse(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)]
    return [
        call for call in calls if call.endswith((".link.send", ".mav.send")) or ("mav." in call and "_send" in call)
    ]


def test_nobody_else_has_a_way_to_a_vehicle() -> None:
    found = {name for name, tree in trees("|".join(PRIVATE)).items() if users_of(tree)}
    others = {name for name in found if name.startswith("mavproxy_uavapi/core")} - HOLDERS.keys()
    assert others == set()


def test_nobody_sends_past_the_command() -> None:
    found = {
        f"{name}: {call}"
        for name, tree in trees("send").items()
        if not name.startswith(SIMULATOR)
        for call in senders(tree)
    }
    assert found == {"mavproxy_uavapi/core/link/link.py: master.mav.send"}


def test_a_way_past_the_command_is_found() -> None:
    assert senders(ast.parse("await vehicle.link.send(message, 1)")) == ["vehicle.link.send"]
    assert senders(ast.parse("master.mav.set_mode_send(1, 2, 3)")) == ["master.mav.set_mode_send"]
    assert users_of(ast.parse("vehicle._sender.send(order)")) == {"_sender"}
