"""The page's modules: what only computes under Node.js, where that is, and all of them in a real browser."""

from __future__ import annotations

import asyncio
import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from mavproxy_uavapi.http.handlers.page import FOLDER
from tests.support.chromium import chromium
from tests.support.page_server import ROOT, files_of_the_page

TESTS = Path(__file__).with_name("page")
COMPUTING = sorted(TESTS.rglob("*.test.js"))
PANELS = sorted(TESTS.rglob("*.dom.js"))  # what needs elements
HARNESS = "tests/uavapi/page/support/browser.html"


def test_each_file_of_tests_has_its_module() -> None:
    modules = {file.relative_to(FOLDER).with_suffix("").as_posix() for file in FOLDER.rglob("*.js")}
    tested = {file.relative_to(TESTS).as_posix().partition(".")[0] for file in (*COMPUTING, *PANELS)}
    assert tested - modules == set()


@pytest.mark.long  # a browser runs the same files in a tenth of the time
@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed: a browser runs the same files")
def test_what_computes_does_so_under_node() -> None:
    command = ["node", "--test", "--test-force-exit", "--test-timeout=60000", *map(str, COMPUTING)]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=240, check=False)
    failed = re.findall(r"^ *not ok .*?^ *\.\.\.$", run.stdout, re.MULTILINE | re.DOTALL)
    assert run.returncode == 0, "\n".join(failed) or run.stdout + run.stderr


@pytest.mark.needs("chromium")
def test_modules_and_panels_do_what_they_say_in_a_browser(tmp_path: Path) -> None:
    async def look() -> tuple[int, list[str]]:
        with files_of_the_page() as address:
            async with chromium(tmp_path) as page:
                await page.visit(f"{address}/{HARNESS}")
                await page.until("typeof runTests === 'function'")
                files = [f"/{file.relative_to(ROOT).as_posix()}" for file in (*COMPUTING, *PANELS)]
                outcome = await page.evaluate(f"runTests({json.dumps(files)})")
                return outcome["count"], outcome["failed"]

    count, failed = asyncio.run(look())
    assert failed == []
    assert count >= 60


def test_locked_linters_come_from_whatever_registry_npm_is_told_of() -> None:
    locked = json.loads((ROOT / "package-lock.json").read_text(encoding="utf-8"))["packages"]
    assert not any("resolved" in package for package in locked.values())
    assert all("integrity" in package for name, package in locked.items() if name)
