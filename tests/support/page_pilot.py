"""Somebody who flies from the page at /, in a real browser."""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from tests.support.chromium import TIMEOUT, Page

ESCAPE = 27
BUTTON = "[...document.querySelectorAll('{tag}')].find(b => b.textContent === '{label}' && b.checkVisibility())"
WATCHED_HOLD = """
{{
  const element = {element}, {{button}} = element;
  const begin = () => {{ hold.pressed = hold.disabled = false; return !button.disabled; }};
  const hold = window.hold = {{element, begin, acted: false}};
  element.addEventListener('confirmed', () => hold.acted = true);
  for (const kind of ['pointerdown', 'keydown']) element.addEventListener(kind, () => hold.pressed = true);
  new MutationObserver(() => hold.disabled = true).observe(button, {{attributeFilter: ['disabled']}});
}}"""
"""What happens to a button: whether it was pressed, disabled since `begin`, and has acted."""
LIVE = "document.querySelector('connection-state').innerText.trim() === 'live'"
Act = Callable[..., Awaitable[object]]


class Pilot:
    """Somebody in front of the page."""

    def __init__(self, page: Page, rig: Any) -> None:
        self.page, self.rig = page, rig

    async def sees(self, element: str, text: str, seconds: float = TIMEOUT) -> None:
        """Wait until an element shows that text."""
        await self.page.until(f"document.querySelector({element!r}).innerText.includes({text!r})", seconds)

    async def sees_live(self) -> None:
        """Wait until the page says that its numbers are live, and all of it is there; it says `not live` before."""
        await self.page.until(LIVE)
        await self.page.until("Boolean(document.querySelector('tab-bar')?.context)")

    async def hold(self, label: str) -> None:
        """Hold a button until it acts."""
        await self.hold_the(BUTTON.format(tag="hold-button", label=label))

    async def hold_the(self, element: str) -> None:
        """Hold the button that the script `element` gives, until it acts."""
        await self._hold(element, self.page.press, self.page.release)

    async def hold_by_touch(self, label: str) -> None:
        """Hold a finger on a button until it acts."""
        element = BUTTON.format(tag="hold-button", label=label)
        await self._hold(element, self.page.touch, lambda *_: self.page.lift())

    async def hold_by_key(self, label: str, key: str, code: int) -> None:
        """Put the focus on a button and hold a key until it acts."""
        element = BUTTON.format(tag="hold-button", label=label)

        async def press(*_: float) -> None:
            await self.page.evaluate(f"{element}.button.focus()")
            await self.page.key("keyDown", key, code)

        await self._hold(element, press, lambda *_: self.page.key("keyUp", key, code))

    async def _hold(self, element: str, press: Act, release: Act) -> None:
        """Hold a button until it acts; `press` and `release` take the button's place.

        The page ends a hold when it disables the button, as it does when no news come for a while: then again.
        """
        await self.page.until(f"Boolean({element})")
        await self.page.evaluate(WATCHED_HOLD.format(element=element))
        while not await self.page.evaluate("hold.acted"):
            await self.page.until("hold.begin()")
            place = await self.page.middle(element)
            await press(*place)
            await self.page.until("hold.acted || hold.disabled || hold.pressed && !hold.element.matches('.held')")
            await release(*place)
            assert await self.page.evaluate("hold.acted || hold.disabled"), f"the hold of {element} has ended"

    async def press_twice(self, label: str) -> None:
        """Press a button as assistive technology does, which cannot hold it."""
        element = BUTTON.format(tag="hold-button", label=label)
        await self.page.until(f"!{element}.button.disabled")
        await self.page.evaluate(f"window.acted = false; {element}.addEventListener('confirmed', () => acted = true)")
        await self.page.evaluate(f"{element}.button.click()")
        await self.page.until(f"{element}.button.ariaLabel.includes('press again to confirm')")
        assert not await self.page.evaluate("acted")
        await self.page.evaluate(f"{element}.button.click()")
        await self.page.until("acted")

    async def click(self, label: str) -> None:
        """Click a button."""
        await self.page.click(BUTTON.format(tag="button", label=label))

    async def hold_all_by_key(self) -> None:
        """Hold Escape."""
        await self.page.key("keyDown", "Escape", ESCAPE)
        await self.page.until("!document.getElementById('hold-result').hidden")
        await self.page.key("keyUp", "Escape", ESCAPE)

    async def finds_it_accessible(self) -> None:
        """Let axe-core look at the page as it is; it may find nothing."""
        spec = find_spec("axe_core_python")
        assert spec is not None and spec.origin is not None
        await self.page.evaluate(Path(spec.origin).with_name("axe.min.js").read_text(encoding="utf-8") + ";0")
        violations = json.loads(await self.page.evaluate("axe.run().then(r => JSON.stringify(r.violations))"))
        found = [(one["id"], [node["html"] for node in one["nodes"]]) for one in violations]
        assert found == [], found
