"""/docs: Swagger UI for /openapi.json, without internet: its files come from the package swagger-ui-py."""

from __future__ import annotations

import asyncio
from importlib.util import find_spec
from pathlib import Path

from aiohttp import web

from mavproxy_uavapi.core.errors import NotFound
from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.handlers import static_files

PACKAGE = "swagger_ui"
ASSETS = {
    "swagger-ui.css": "text/css",
    "swagger-ui-bundle.js": "text/javascript",
    "favicon-32x32.png": "image/png",
}
# Only our own scripts run there; Swagger UI itself sets styles on elements and has its icons in the CSS.
HEADERS = static_files.headers("script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:")
PAGE = """\
<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>mavproxy-uavapi</title>
<link rel="icon" href="{folder}/favicon-32x32.png">
<link rel="stylesheet" href="{folder}/swagger-ui.css">
</head>
<body>
<div id="page"></div>
<script src="{folder}/swagger-ui-bundle.js"></script>
<script src="{folder}/start.js"></script>
</body>
</html>
"""
START = "start.js"
SCRIPT = """\
window.ui = SwaggerUIBundle({
  url: new URL("../openapi.json", document.currentScript.src).href,
  dom_id: "#page",
  deepLinking: true,
  displayRequestDuration: true,
  docExpansion: "list",
  defaultModelsExpandDepth: -1,
  filter: true,
  persistAuthorization: false,
  tryItOutEnabled: true,
  validatorUrl: null,
});
"""


async def page(call: Call) -> web.StreamResponse:
    """The documentation as a page on which each endpoint can be tried."""
    if await asyncio.to_thread(_folder) is None:
        raise NotFound("the page needs swagger-ui-py (pip install swagger-ui-py); /openapi.json works without it")
    # Relative to the page, which may be below a path of a proxy.
    html = PAGE.format(folder="." if call.request.path.endswith("/") else "docs")
    return static_files.answer(call.request, html.encode(), "text/html", HEADERS)


async def asset(call: Call) -> web.StreamResponse:
    """A file of the documentation page."""
    name = call.names["file"]
    if name == START:
        return static_files.answer(call.request, SCRIPT.encode(), "text/javascript", HEADERS)
    kind = ASSETS.get(name)
    folder = await asyncio.to_thread(_folder)
    if kind is None or folder is None:
        raise NotFound(f"the documentation has no file {name}")
    # The kernel sends the file: a copy for each stranger who does not read it would cost 1.4 MB.
    return web.FileResponse(folder / name, headers={**HEADERS, "Content-Type": kind})


def _folder() -> Path | None:
    """The folder of the package's files; the package is not imported, because that would import web frameworks."""
    spec = find_spec(PACKAGE)
    if spec is None or spec.origin is None:
        return None
    return Path(spec.origin).parent / "static"
