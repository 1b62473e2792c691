"""A script's file -> its runner."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from pathlib import Path
from types import ModuleType

from mavproxy_uavapi.aerpaw.exceptions import StateMachineError
from mavproxy_uavapi.aerpaw.runner import BasicRunner, Runner, StateMachine
from mavproxy_uavapi.aerpaw.zmq_runner import ZmqStateMachine

BASES = (Runner, BasicRunner, StateMachine, ZmqStateMachine)


def load(script: str) -> ModuleType:
    """The module of a script: a file, with or without `.py`, or a dotted name.

    Raises:
        FileNotFoundError: there is none.
        Exception: what the script itself raises.
    """
    path = Path(script)
    if path.suffix != ".py":
        path = path.with_name(path.name + ".py")
    sys.path.insert(0, str(Path.cwd()))
    if not path.is_file():
        if "/" in script or script.endswith(".py"):
            raise FileNotFoundError(f"there is no script {script}")
        return importlib.import_module(script)
    path = path.resolve()
    sys.path.insert(0, str(path.parent))  # what lies beside it can be imported
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = sys.modules[path.stem] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def runner_of(module: ModuleType) -> type[Runner]:
    """The one runner of a script: what others of it derive from does not count.

    Raises:
        StateMachineError: it has none, or more than one.
    """
    classes = dict.fromkeys(value for value in vars(module).values() if isinstance(value, type))
    there = [one for one in classes if issubclass(one, Runner) and one not in BASES]
    last = [one for one in there if not any(one in other.__mro__[1:] for other in there)]
    if len(last) != 1:
        names = ", ".join(one.__name__ for one in last) or "none"
        raise StateMachineError(f"{module.__name__} must define one runner; it has {names}")
    return last[0]
