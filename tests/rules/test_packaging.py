"""The files in packaging/ name what the station has: its metrics, its options, and what its broker must keep."""

from __future__ import annotations

import asyncio
import json
import re
from pathlib import Path

from mavproxy_gradys.station.fleet import AlarmLimits
from mavproxy_gradys.station.fleet_watch import FleetWatch
from mavproxy_gradys.station.health import StationHealth
from mavproxy_gradys.station.inbox import Inbox
from mavproxy_gradys.station.intake import Intake
from mavproxy_gradys.station.metrics import StationCollector, exposition
from mavproxy_gradys.station.options import parser
from mavproxy_gradys.station.sqlite_store import SqliteStore
from mavproxy_gradys.station.statistics import Statistics

PACKAGING = Path(__file__).parents[2] / "packaging"


class Broker:
    problem = ""


def test_the_dashboard_asks_for_metrics_that_there_are(tmp_path: Path) -> None:
    store = SqliteStore(tmp_path / "station.db")
    watch = FleetWatch(store, AlarmLimits(10, 20))
    health = StationHealth(watch, Intake(store, Statistics()), Inbox(1, lambda: 0.0), Broker())
    text = exposition(StationCollector(Statistics(), watch, health)).decode()
    exported = set(re.findall(r"^(station_\w+)", text, re.MULTILINE))
    asyncio.run(store.close())
    panels = json.loads((PACKAGING / "grafana-station.json").read_text(encoding="utf-8"))["panels"]
    requested = {
        name for panel in panels for one in panel["targets"] for name in re.findall(r"station_[a-z_]+", one["expr"])
    }
    assert len(requested) >= 10 and requested <= exported


def test_the_unit_starts_a_worker() -> None:
    unit = (PACKAGING / "mavproxy-gradys-station@.service").read_text(encoding="utf-8")
    (command,) = re.findall(r"^ExecStart=\S+ -m mavproxy_gradys.station (.*)$", unit, re.MULTILINE)
    assert parser().parse_args(command.replace("%i", "8081").split()).port == 8081


def test_the_broker_drops_nothing_and_keeps_what_it_has() -> None:
    lines = (PACKAGING / "mosquitto.conf").read_text(encoding="utf-8").splitlines()
    settings = dict(line.split(maxsplit=1) for line in lines if line and not line.startswith("#"))
    assert settings["max_queued_messages"] == settings["max_inflight_messages"] == "0"
    assert settings["persistence"] == "true" and settings["allow_anonymous"] == "false"
