"""Loads a script and finds its runner."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from pathlib import Path
from types import ModuleType

from mavproxy_uavapi.aerpaw.exceptions import StateMachineError
from mavproxy_uavapi.aerpaw.runner import Runner

OURS = Runner.__module__.rpartition(".")[0]  # this package, which has the base classes


def load(script: str) -> ModuleType:
    """Import a script: a file, with or without `.py`, or a dotted name.

    Raises:
        FileNotFoundError: there is no such file.
        Exception: an error of the script itself.
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
    sys.path.insert(0, str(path.parent))  # so that it can import modules beside it
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = sys.modules[path.stem] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def runner_of(module: ModuleType) -> type[Runner]:
    """The only runner class of a script; base classes of other runners do not count.

    Raises:
        StateMachineError: it has none, or more than one.
    """
    classes = dict.fromkeys(value for value in vars(module).values() if isinstance(value, type))
    runners = [one for one in classes if issubclass(one, Runner) and not one.__module__.startswith(OURS)]
    leaves = [one for one in runners if not any(one in other.__mro__[1:] for other in runners)]
    if len(leaves) != 1:
        names = ", ".join(one.__name__ for one in leaves) or "none"
        raise StateMachineError(f"{module.__name__} must define one runner; it has {names}")
    return leaves[0]
