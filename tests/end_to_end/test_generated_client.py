"""A client that openapi-python-client makes of /openapi.json flies the embedded vehicle."""

from __future__ import annotations

import json
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from tests.support.processes import Rig

pytestmark = pytest.mark.long

# The generator knows no other type of a file.
OVERRIDES = ("text/plain", "text/xml", "application/xml", "image/jpeg", "application/vnd.google-earth.kml+xml")
OVERRIDES += ("application/vnd.google-earth.kmz", "text/css", "text/javascript", "image/png", "text/event-stream")
OVERRIDES += ("application/geo+json", "text/html", "multipart/x-mixed-replace")
FLIGHT = """
    import sys

    from made import Client
    from made.api.command import post_command_arm, post_command_land, post_command_takeoff
    from made.api.one_vehicle import get_vehicles_sysid_telemetry_gps, post_vehicles_sysid_command_set_mode
    from made.models import Failure, InfoGpsView, ModeName, Success, Takeoff

    client = Client(sys.argv[1], timeout=60)
    armed = post_command_arm.sync(client=client)
    assert isinstance(armed, Success) and armed.result == "Armed vehicle", armed
    up = post_command_takeoff.sync(client=client, body=Takeoff(alt=12))
    assert isinstance(up, Success), up
    gps = get_vehicles_sysid_telemetry_gps.sync(1, client=client)
    assert isinstance(gps, InfoGpsView) and abs(gps.info.position.relative_alt - 12) < 1.5, gps
    refused = post_vehicles_sysid_command_set_mode.sync(1, client=client, body=ModeName(mode="NOWHERE"))
    assert isinstance(refused, Failure) and refused.code == "invalid", refused
    down = post_command_land.sync(client=client)
    assert isinstance(down, Success), down
"""


def test_generated_client_is_made_without_a_warning_and_flies(embedded_rig: Rig, tmp_path: Path) -> None:
    (tmp_path / "openapi.json").write_text(json.dumps(embedded_rig.ok(embedded_rig.get("/openapi.json"))))
    settings = {"content_type_overrides": dict.fromkeys(OVERRIDES, "application/octet-stream"), "post_hooks": []}
    (tmp_path / "config.json").write_text(json.dumps(settings))
    generate = [sys.executable, "-m", "openapi_python_client", "generate", "--path", "openapi.json"]
    generate += ["--output-path", "made", "--meta", "none", "--config", "config.json", "--fail-on-warning"]
    made = subprocess.run(generate, cwd=tmp_path, check=False, capture_output=True, text=True)
    assert made.returncode == 0, made.stdout + made.stderr
    flight = [sys.executable, "-c", textwrap.dedent(FLIGHT), embedded_rig.url]
    flown = subprocess.run(flight, cwd=tmp_path, check=False, capture_output=True, text=True)
    assert flown.returncode == 0, flown.stderr
