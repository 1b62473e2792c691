"""The settings that outlive a module: MAVProxy reloads it by an unload and a load without keywords."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from mavproxy_uavapi.core.terminal import say

ATTRIBUTE = "uavapi_remembered"  # on MAVProxy's state: remembered for as long as MAVProxy runs
UNSHOWN = {"origins"}  # keywords that are no settings


class RememberedSettings:
    """The keywords of one module's `module load`, and what was set at the prompt since.

    A load without keywords uses those of the load before; a load with keywords replaces them. The INI file that
    the keyword `config` names is read again.

    Args:
        mpstate: MAVProxy's state.
        module: its name.
        keywords: of this load.
    """

    def __init__(self, mpstate: Any, module: str, keywords: Mapping[str, Any]) -> None:
        if not hasattr(mpstate, ATTRIBUTE):
            setattr(mpstate, ATTRIBUTE, {})
        self._all: dict[str, RememberedSettings] = getattr(mpstate, ATTRIBUTE)
        self._module = module
        before = None if keywords else self._all.get(module)
        self.keywords = dict(keywords) if before is None else before.keywords
        self.changed: dict[str, Any] = {} if before is None else before.changed
        self.taken_over = before is not None and bool(self.keywords or self.changed)

    @property
    def combined(self) -> dict[str, Any]:
        """Keywords and changes together; changes win, and `origins` says which these are."""
        origins = {**self.keywords.get("origins", {}), **dict.fromkeys(self.changed, f"{self._module} set")}
        return {**self.keywords, **self.changed, "origins": origins}

    def keep(self, shown: Callable[[str], object]) -> None:
        """Remember this from now on, and print what was taken over. Not called if the module refuses them.

        Args:
            shown: gives the value of a setting as the prompt may show it.
        """
        self._all[self._module] = self
        if self.taken_over:
            pairs = [f"{n}={v if n == 'config' else shown(n)}" for n, v in self.combined.items() if n not in UNSHOWN]
            say(f"{self._module}: as before: {', '.join(pairs)} (keywords at `module load` replace all that)")

    def change(self, name: str, value: Any) -> None:
        """Note that a setting was set at the prompt."""
        self.changed[name] = value
