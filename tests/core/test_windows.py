"""What a module shows in MAVProxy's console and map: with MAVProxy's own shapes, and windows that record."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.windows import PERIOD, ROW, View, Windows
from tests.support.virtual_time import FastLoop
from tests.support.windows import open_console, open_map

pytest.importorskip("cv2")  # the shapes of MAVProxy's map need it

HERE = (-35.363261, 149.16523)
A_METRE_NORTH = (HERE[0] + 1 / 111_319, HERE[1])
CENTIMETRES_NORTH = (HERE[0] + 0.05 / 111_319, HERE[1])


class Shown:
    """A module's windows, and the view that it makes."""

    def __init__(self, host: Host, mpstate: SimpleNamespace, loop: FastLoop) -> None:
        self.view, self.computed = View(), 0
        self.host, self.loop = host, loop
        self.windows = Windows("demo", mpstate, host.bridge, host.clock, self.make)

    def make(self) -> View:
        self.computed += 1
        return self.view

    def pass_time(self, seconds: float = PERIOD) -> None:
        """MAVProxy's idle tasks for so long."""
        for _ in range(round(seconds / 0.1)):
            self.windows.turn()
            self.loop.pass_time(0.1)
            self.host.bridge.turn()


@pytest.fixture
def shown(host: Host, mpstate: SimpleNamespace, loop: FastLoop) -> Shown:
    return Shown(host, mpstate, loop)


def test_without_windows_nothing_is_computed(shown: Shown) -> None:
    shown.pass_time(5.0)
    assert shown.computed == 0


def test_a_line_stands_below_those_of_mavproxy_and_is_set_when_it_changes(
    shown: Shown, mpstate: SimpleNamespace
) -> None:
    console = open_console(mpstate)
    shown.view = View("anna flies")
    shown.pass_time(5.0)
    assert (console.lines, console.count) == ({"demo": ("anna flies", ROW)}, 1)
    assert shown.computed == pytest.approx(5, abs=1)
    shown.view = View("nobody flies")
    shown.pass_time()
    assert console.lines["demo"][0] == "nobody flies"
    assert open_console(mpstate).lines == {}
    shown.pass_time()
    assert mpstate.console.lines["demo"][0] == "nobody flies"  # `module reload console`


def test_a_module_without_a_line_has_none(shown: Shown, mpstate: SimpleNamespace) -> None:
    console = open_console(mpstate)
    shown.pass_time(3.0)
    assert console.count == 0


def test_a_place_is_a_circle_with_a_text_and_is_drawn_again_where_it_moves(
    shown: Shown, mpstate: SimpleNamespace
) -> None:
    window = open_map(mpstate)
    shown.view = View(places={"tag 0": HERE})
    shown.pass_time(3.0)
    circle, text = window.objects["demo tag 0"], window.objects["demo tag 0 text"]
    assert (circle.latlon, circle.layer, text.point, text.label) == (HERE, "demo", HERE, "tag 0")
    shown.view = View(places={"tag 0": CENTIMETRES_NORTH})
    shown.pass_time(3.0)
    assert window.count == 2
    shown.view = View(places={"tag 0": A_METRE_NORTH})
    shown.pass_time()
    assert (window.count, window.objects["demo tag 0"].latlon) == (4, A_METRE_NORTH)
    shown.view = View()
    shown.pass_time()
    assert window.objects == {}


def test_a_map_that_is_opened_later_gets_all_places(shown: Shown, mpstate: SimpleNamespace) -> None:
    open_map(mpstate)
    shown.view = View(places={"tag 0": HERE})
    shown.pass_time()
    window = open_map(mpstate)
    shown.pass_time()
    assert set(window.objects) == {"demo tag 0", "demo tag 0 text"}
    mpstate.map = None  # `module unload map`
    shown.pass_time()


def test_an_unloaded_module_leaves_nothing(shown: Shown, mpstate: SimpleNamespace) -> None:
    console, window = open_console(mpstate), open_map(mpstate)
    shown.view = View("anna flies", {"tag 0": HERE})
    shown.pass_time()
    shown.pass_time(0.9)
    shown.windows.turn()
    shown.loop.pass_time(0.1)  # a view is on its way
    shown.windows.clear()
    shown.host.bridge.turn()
    assert (console.lines["demo"][0], window.objects) == ("", {})
