"""Provides aerpawlib's module names by an import hook, only in a process that calls `serve`.

If the real package is installed, nothing is served, unless `real` is set; then `util` is the real one.
"""

from __future__ import annotations

import importlib
import importlib.abc
import importlib.machinery
import importlib.metadata
import sys
from collections.abc import Mapping, Sequence
from types import ModuleType

PACKAGE = "aerpawlib"
OURS = "mavproxy_uavapi.aerpaw"
SAFETY = ("safety_wire", "safety", "safety_server")
VEHICLES = ("vehicle", "drone", "rover", "dummy_vehicle")
RUNNERS_V2 = ("decorators", "v2.runner")
VEHICLES_V2 = ("v2.vehicle", "v2.task")
# Our modules that provide the names of each of aerpawlib's modules.
V1: Mapping[str, Sequence[str]] = {
    "aerpaw": ("platform",),
    "constants": ("constants",),
    "exceptions": ("exceptions",),
    "external": ("external",),
    "helpers": ("helpers",),
    "log": ("log",),
    "runner": ("runner", "zmq_runner", "decorators"),
    "runner.decorators": ("decorators",),
    "runner.impl": ("runner", "zmq_runner", "decorators", "zmq_proxy"),
    "safety": SAFETY,
    "safety.client": ("safety",),
    "safety.server": ("safety_server",),
    "safety.wire_format": ("safety_wire",),
    "safetyChecker": SAFETY,
    "util": ("geofence", "geometry", "plans", "util"),
    "util.geofence": ("geofence",),
    "util.geometry": ("geometry",),
    "util.plan_io": ("plans",),
    "util.ports": ("util",),
    "vehicle": VEHICLES,
    "vehicle.core_vehicle": VEHICLES,
    "vehicle.drone": VEHICLES,
    "vehicle.dummy_vehicle": VEHICLES,
    "vehicle.rover": VEHICLES,
    "zmqutil": ("zmq_proxy",),
}
V2: Mapping[str, Sequence[str]] = {
    "aerpaw": ("v2.platform",),
    "constants": ("constants",),
    "exceptions": ("exceptions",),
    "external": ("v2.external",),
    "geofence": ("geofence",),
    "log": ("log", "v2.log"),
    "plan": ("plans",),
    "runner": RUNNERS_V2,
    "runner.config": RUNNERS_V2,
    "runner.decorators": RUNNERS_V2,
    "runner.impl": (*RUNNERS_V2, "zmq_proxy"),
    "safety": ("v2.safety",),
    "safety.checker": ("v2.safety",),
    "safety.connection": ("v2.safety",),
    "safety.validation": ("v2.safety",),
    "testing": ("v2.vehicle",),
    "types": ("geometry", "readings"),
    "vehicle": VEHICLES_V2,
    "vehicle.base": VEHICLES_V2,
    "vehicle.drone": VEHICLES_V2,
    "vehicle.rover": VEHICLES_V2,
    "vehicle.task": VEHICLES_V2,
    "zmqutil": ("zmq_proxy",),
}
LEGACY = ("aerpaw", "external", "log", "runner", "safetyChecker", "util", "vehicle", "zmqutil")  # also without `v1.`


class AlreadyInstalled(Exception):
    """The real aerpawlib is installed."""


def _served() -> dict[str, Sequence[str]]:
    served: dict[str, Sequence[str]] = {f"{PACKAGE}.structured_log": ("event_log",)}
    for version, modules in (("v1", V1), ("v2", V2)):
        served[f"{PACKAGE}.{version}"] = tuple(dict.fromkeys(name for names in modules.values() for name in names))
        served |= {f"{PACKAGE}.{version}.{name}": ours for name, ours in modules.items()}
    served[PACKAGE] = served[f"{PACKAGE}.v1"]
    return served | {f"{PACKAGE}.{name}": V1[name] for name in LEGACY}


class Finder(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Maps aerpawlib's modules to ours; modules that it does not serve cannot be imported.

    Args:
        real_util: whether to serve the real package's `util` instead of ours.
    """

    def __init__(self, real_util: bool = False) -> None:
        self._served = _served()
        self._real = _real_util() if real_util else {}

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        """See `importlib.abc.MetaPathFinder`."""
        if name not in self._served:
            if name == PACKAGE or name.startswith(f"{PACKAGE}."):
                raise ModuleNotFoundError(f"{name} is not served here; aerpawlib's v1 and v2 are", name=name)
            return None
        spec = importlib.machinery.ModuleSpec(name, self, origin=OURS)
        spec.submodule_search_locations = []  # all of them may be packages
        return spec

    def create_module(self, spec: importlib.machinery.ModuleSpec) -> ModuleType | None:
        """Use the default module."""
        return None

    def exec_module(self, module: ModuleType) -> None:
        """Copy the public names of our modules into it."""
        for ours in self._served[module.__name__]:
            source = self._real.get(ours) or importlib.import_module(f"{OURS}.{ours}")
            vars(module).update(_public(source))
        if module.__name__ == PACKAGE:
            importlib.import_module(f"{PACKAGE}.v1")  # so that `import aerpawlib` is enough for `aerpawlib.v1`


def _public(module: ModuleType) -> Mapping[str, object]:
    """Its names, without modules, and without what it imports from elsewhere."""
    own = (OURS, PACKAGE, "builtins")  # the last of a type such as `dict[str, float]`
    return {
        name: value
        for name, value in vars(module).items()
        if not (name.startswith("_") or isinstance(value, ModuleType))
        and getattr(value, "__module__", OURS).startswith(own)
    }


def _real_util() -> dict[str, ModuleType]:
    """The real `util`, by our module's name; all other modules of the real package are unloaded."""
    real = importlib.import_module(f"{PACKAGE}.v1.util")
    for name in [name for name in sys.modules if name == PACKAGE or name.startswith(f"{PACKAGE}.")]:
        del sys.modules[name]
    return {"util": real}


def is_installed() -> bool:
    """Whether the real package is installed; a copy in the current folder does not count."""
    try:
        importlib.metadata.distribution(PACKAGE)
    except importlib.metadata.PackageNotFoundError:
        return False
    return True


def serve(*, real: bool = False) -> None:
    """Serve aerpawlib's names from now on.

    Args:
        real: serve them even if the real package is installed, with its `util`.

    Raises:
        AlreadyInstalled: it is installed and `real` is not set.
    """
    if any(isinstance(finder, Finder) for finder in sys.meta_path):
        return
    if is_installed() and not real:
        raise AlreadyInstalled(
            "aerpawlib itself is installed here and is not replaced; --real runs its scripts here, with its own util"
        )
    sys.meta_path.insert(0, Finder(real_util=real and is_installed()))
