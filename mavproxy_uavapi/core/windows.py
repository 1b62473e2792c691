"""What our modules show in MAVProxy's windows: a line in its console, and places on its map.

Without these windows (modules `console` and `map`) nothing is computed or shown.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from mavproxy_uavapi.core.geodesy import offset
from mavproxy_uavapi.core.mainloop.bridge import Bridge
from mavproxy_uavapi.core.text import line_of

PERIOD = 1.0  # s
ROW = 4  # of the console's status lines; MAVProxy uses those from 0 to 3
MOVED = 0.3  # m by which a place must move to be drawn again
RADIUS = 1.0  # m of a place's circle
YELLOW = (255, 255, 0)  # red, green, blue

Place = tuple[float, float]  # latitude and longitude, degrees


@dataclass(frozen=True)
class View:
    """What a module shows.

    Attributes:
        line: for the console; empty for none.
        places: for the map, by label.
    """

    line: str = ""
    places: Mapping[str, Place] = field(default_factory=dict)


class Windows:
    """A module's part of MAVProxy's windows. Its methods belong to MAVProxy's main loop.

    Args:
        name: the module's name.
        mpstate: MAVProxy's state.
        bridge: to the asyncio thread, where the view is made.
        clock: monotonic seconds.
        make: makes the view, in the asyncio thread.
    """

    def __init__(
        self, name: str, mpstate: Any, bridge: Bridge, clock: Callable[[], float], make: Callable[[], View]
    ) -> None:
        self._name, self._mpstate, self._bridge, self._clock, self._make = name, mpstate, bridge, clock, make
        self._due = 0.0
        self._line: tuple[Any, str] = (None, "")  # the console, and what it shows
        self._map: Any = None
        self._drawn: dict[str, Place] = {}

    def turn(self) -> None:
        """Show what has changed; called in every idle task."""
        now = self._clock()
        if now < self._due:
            return
        self._due = now + PERIOD
        if self._console is not None or self._current_map is not None:
            self._bridge.call_soon(self._look)

    def clear(self) -> None:
        """Remove everything, for good."""
        self._show(View())
        self._make = View  # a view that is on its way is not shown

    @property
    def _console(self) -> Any:
        """The window; without one MAVProxy has a console that only prints."""
        return self._mpstate.console if "console" in self._mpstate.public_modules else None

    @property
    def _current_map(self) -> Any:
        return getattr(self._mpstate, "map", None)

    def _look(self) -> None:
        make = self._make
        made = make()
        view = View(line_of(made.line), {line_of(label): place for label, place in made.places.items()})
        self._bridge.post(lambda: self._show(view) if make is self._make else None)

    def _show(self, view: View) -> None:
        console = self._console
        if console is not None and self._line != (console, view.line) and (view.line or self._line[0] is console):
            console.set_status(self._name, view.line, row=ROW)
            self._line = console, view.line
        window = self._current_map
        if window is not self._map:
            self._map, self._drawn = window, {}
        if window is not None:
            self._draw(window, view.places)

    def _draw(self, window: Any, places: Mapping[str, Place]) -> None:
        for label in [label for label in self._drawn if label not in places]:
            del self._drawn[label]
            for key in self._keys(label):
                window.remove_object(key)
        for label, place in places.items():
            drawn = self._drawn.get(label)
            if drawn is None or max(map(abs, offset(*drawn, *place))) > MOVED:
                self._drawn[label] = place
                self._draw_place(window, label, place)

    def _draw_place(self, window: Any, label: str, place: Place) -> None:
        # MAVProxy's map imports OpenCV, which it needs itself; we do not.
        from MAVProxy.modules.mavproxy_map import mp_slipmap_util as shapes  # noqa: PLC0415

        circle, text = self._keys(label)
        window.add_object(shapes.SlipCircle(circle, self._name, place, RADIUS, YELLOW, 2))
        window.add_object(shapes.SlipLabel(text, place, label, self._name, YELLOW))

    def _keys(self, label: str) -> tuple[str, str]:
        """The keys of a place's circle and of its text, unique on the map."""
        return f"{self._name} {label}", f"{self._name} {label} text"
