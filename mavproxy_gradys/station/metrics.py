"""What Prometheus reads at `/metrics`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily, Metric
from prometheus_client.registry import Collector

from mavproxy_gradys.station.fleet import LOW_BATTERY, SILENT
from mavproxy_gradys.station.fleet_watch import FleetWatch
from mavproxy_gradys.station.health import Health
from mavproxy_gradys.station.statistics import Histogram, Statistics


class StationCollector(Collector):
    """One worker's numbers.

    Args:
        statistics: what it has done.
        watch: the fleet as it sees it.
        health: whether it reaches broker and database.
    """

    def __init__(self, statistics: Statistics, watch: FleetWatch, health: Health) -> None:
        self._statistics = statistics
        self._watch = watch
        self._health = health

    def collect(self) -> Iterable[Metric]:
        """All of them."""
        statistics = self._statistics
        counts = (
            ("readings_stored", "readings that this worker has kept", statistics.stored),
            ("readings_repeated", "readings that came again", statistics.repeats),
            ("readings_confirmed", "readings whose senders were told", statistics.confirmed),
            ("messages_refused", "messages that are no readings", statistics.refused),
            ("messages_dropped", "messages of former connections, beyond the inbox", self._health.dropped),
            ("batches", "transactions", statistics.batches),
        )
        for name, text, count in counts:
            yield CounterMetricFamily(f"station_{name}", text, value=count)
        yield histogram("station_commit_seconds", "s of a transaction", statistics.commit)
        yield histogram("station_delay_seconds", "s from sampling to row", statistics.delay)
        yield from self._gauges()

    def _gauges(self) -> Iterable[Metric]:
        health = self._health
        yield GaugeMetricFamily("station_messages_waiting", "messages not stored yet", value=health.waiting)
        yield GaugeMetricFamily("station_database_up", "whether the database answers", value=not health.database)
        if health.broker is not None:
            yield GaugeMetricFamily("station_broker_up", "whether the broker is connected", value=not health.broker)
        yield GaugeMetricFamily("station_vehicles", "vehicles of the last day", value=len(self._watch.vehicles))
        raised = Counter(alarm.kind for alarm in self._watch.alarms)
        family = GaugeMetricFamily("station_alarms", "vehicles with an alarm", labels=["kind"])
        for kind in (SILENT, LOW_BATTERY):
            family.add_metric([kind], raised[kind])
        yield family


def histogram(name: str, text: str, values: Histogram) -> Metric:
    """A histogram as Prometheus wants it: counts of all values up to each bound."""
    total, buckets = 0, []
    for bound, count in zip((*map(str, values.bounds), "+Inf"), values.counts, strict=True):
        total += count
        buckets.append((bound, total))
    return HistogramMetricFamily(name, text, buckets=buckets, sum_value=values.sum)


def exposition(collector: Collector) -> bytes:
    """The text that Prometheus reads."""
    registry = CollectorRegistry(auto_describe=False)
    registry.register(collector)
    return generate_latest(registry)
