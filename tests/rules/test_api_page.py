"""docs/api.md has a line for every endpoint, those of the other modules too, and names every view of the stream."""

from __future__ import annotations

import re
from pathlib import Path

from mavproxy_gradys.http import GradysHandlers
from mavproxy_uavapi.http.routes import ROUTES
from mavproxy_uavapi.http.stream.stream_views import NAMES
from mavproxy_vision.http import VisionHandlers

LINES = (Path(__file__).parents[2] / "docs" / "api.md").read_text(encoding="utf-8").lower().splitlines()
# Neither asks its module for anything until a request comes.
OTHERS = [*GradysHandlers(None).routes(), *VisionHandlers(None, None).routes()]  # type: ignore[arg-type]


def tells_of(line: str, path: str) -> bool:
    """Whether a line names the path: whole, or by its last word beside another path of that folder."""
    folder, _, last = path.rpartition("/")
    whole = any(f"{path}{end}" in line for end in ("`", " ", "?"))
    waiting = last.endswith("_wait") and f"{path.removesuffix('_wait')}`, `…_wait`" in line
    return whole or waiting or (f"{folder}/" in line and f"`{last}`" in line)


def test_each_endpoint_is_in_the_list() -> None:
    paths = {route.path for route in [*ROUTES, *OTHERS] if not route.path.startswith("/fleet/")}
    missing = sorted(path for path in paths if not any(tells_of(line, path) for line in LINES))
    assert missing == [], "add a line to docs/api.md"


def test_each_view_of_the_stream_is_in_the_list() -> None:
    (told,) = re.findall(r"`view` are payloads of this api: (.*?)\.", " ".join(LINES))
    assert sorted(re.findall(r"`(\w+)`", told)) == sorted(NAMES), "docs/api.md lists the views below `### Streams`"
