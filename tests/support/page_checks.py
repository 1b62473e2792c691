"""Scripts that check the page's modules in a browser."""

from __future__ import annotations

import json
from collections.abc import Mapping

from tests.support.chromium import Page

SAME = "const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);"


async def failures(page: Page, address: str, checks: Mapping[str, list[str]], before: str = "") -> list[str]:
    """The checks that did not give true.

    Args:
        page: where they run.
        address: of the server of the page's files.
        checks: module -> scripts, which know it as `m`.
        before: a script that runs before each of them; theirs is what it defines.
    """
    await page.visit(f"{address}/page/theme.css")
    failed = []
    for module, scripts in checks.items():
        for check in scripts:
            script = f"import('/page/{module}.js').then(m => eval({json.dumps(check)})).catch(String)"
            outcome = await page.evaluate(f"(() => {{ {SAME} {before} return {script}; }})()")
            if outcome is not True:
                failed.append(f"{module}: {outcome} of {check}")
    return failed
