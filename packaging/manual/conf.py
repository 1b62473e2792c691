"""Sphinx's settings of the manual: the pages as they are in the checkout, and one made of the API's description.

The folder of its sources, build/manual-pages, has copies of the pages, so that their links lead where they do in a
checkout. Nothing of the site is loaded from another server, and its search needs none.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from typing import Any

from pygments.lexers.special import TextLexer

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))

from mavproxy_gradys.http import GradysHandlers  # noqa: E402
from mavproxy_uavapi import __version__ as release  # noqa: E402
from mavproxy_uavapi.http.openapi import OF_A_VEHICLE, document  # noqa: E402
from mavproxy_uavapi.http.routes import ROUTES  # noqa: E402
from mavproxy_vision.http import VisionHandlers  # noqa: E402

PAGES = ROOT / "build" / "manual-pages"
COPIED = ("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md", "LICENSE", "docs", "examples", "packaging")
# Neither asks its module for anything until a request comes.
OTHERS = [*GradysHandlers(None).routes(), *VisionHandlers(None, None).routes()]  # type: ignore[arg-type]

project = "mavproxy-uavapi"
html_title = f"{project} {release}"
extensions = ["myst_parser"]
myst_heading_anchors = 4
exclude_patterns = ["packaging/manual"]
html_theme = "furo"
suppress_warnings = ["misc.highlighting_failure"]  # of JSON that is shortened
html_copy_source = False
html_show_copyright = False


def endpoints() -> Iterator[str]:
    """The lines of the page: by tag, each path once, with its parameters."""
    description = document([*ROUTES, *OTHERS])
    yield "# Each endpoint"
    yield f"\nMade of `/openapi.json`; `/docs` tries them. `{OF_A_VEHICLE}` before a path means that vehicle.\n"
    about = {tag["name"]: tag["description"] for tag in description["tags"]}
    paths = ((path, item) for path, item in description["paths"].items() if not path.startswith(f"{OF_A_VEHICLE}/"))
    by_tag = sorted(paths, key=lambda entry: [*about].index(tag_of(entry)))
    for tag, entries in groupby(by_tag, tag_of):
        yield f"## {tag}\n\n{about[tag]}\n"
        for path, item in entries:
            yield from endpoint(path, item)


def tag_of(entry: tuple[str, dict[str, Any]]) -> str:
    """The first tag of a path."""
    return str(next(iter(entry[1].values()))["tags"][0])


def endpoint(path: str, item: dict[str, Any]) -> Iterator[str]:
    """The lines of one path."""
    first = next(iter(item.values()))
    yield f"### `{', '.join(map(str.upper, item))} {path}`\n"
    yield f"{first['summary']}\n\n{first.get('description', '')}\n\nRole: {first['x-role']}."
    if first.get("x-codes"):
        yield f"Errors: {', '.join(f'`{code}`' for code in first['x-codes'])}."
    own = [one for one in first.get("parameters", []) if "name" in one]
    if own:
        yield "\n| parameter | what it is |\n| --- | --- |"
        yield from (f"| `{one['name']}` | {one.get('description', '')} |" for one in own)
    yield ""


def setup(app: Any) -> None:
    """Lines of MAVProxy's prompt have no colours."""
    app.add_lexer("mavproxy", TextLexer)


shutil.rmtree(PAGES)  # Sphinx has checked that it is there
PAGES.mkdir()
for name in COPIED:
    copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
    copy(ROOT / name, PAGES / name)
shutil.copy(Path(__file__).parent / "index.md", PAGES)
(PAGES / "endpoints.md").write_text("\n".join(endpoints()) + "\n", encoding="utf-8")
