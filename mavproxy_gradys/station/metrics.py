"""The metrics for Prometheus at `/metrics`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily, Metric
from prometheus_client.registry import Collector

from mavproxy_gradys.station.fleet import LOW_BATTERY, SILENT
from mavproxy_gradys.station.fleet_watch import FleetWatch
from mavproxy_gradys.station.health import StationHealth
from mavproxy_gradys.station.statistics import Histogram, Statistics


class StationCollector(Collector):
    """The metrics of one worker.

    Args:
        statistics: its counts.
        watch: the state of the fleet.
        health: the state of broker and database.
    """

    def __init__(self, statistics: Statistics, watch: FleetWatch, health: StationHealth) -> None:
        self._statistics = statistics
        self._watch = watch
        self._health = health

    def collect(self) -> Iterable[Metric]:
        """All metrics."""
        statistics = self._statistics
        counts = (
            ("readings_stored", "readings that this worker has stored", statistics.stored),
            ("readings_repeated", "readings that arrived again", statistics.repeats),
            ("readings_confirmed", "readings that were confirmed to their senders", statistics.confirmed),
            ("messages_refused", "messages that are not readings", statistics.refused),
            ("messages_dropped", "messages of earlier connections that the inbox dropped", self._health.dropped),
            ("batches", "transactions", statistics.batches),
        )
        for name, text, count in counts:
            yield CounterMetricFamily(f"station_{name}", text, value=count)
        yield histogram("station_commit_seconds", "duration of a transaction, s", statistics.commit)
        yield histogram("station_delay_seconds", "s from measurement to storage", statistics.delay)
        yield from self._gauges()

    def _gauges(self) -> Iterable[Metric]:
        health = self._health
        yield GaugeMetricFamily("station_messages_waiting", "messages not stored yet", value=health.waiting)
        yield GaugeMetricFamily("station_oldest_batch_seconds", "s that a batch has waited", value=health.oldest)
        up = not health.database
        yield GaugeMetricFamily("station_database_up", "whether the database answers and stores", value=up)
        if health.broker is not None:
            yield GaugeMetricFamily("station_broker_up", "whether the broker is connected", value=not health.broker)
        yield GaugeMetricFamily("station_vehicles", "vehicles of the last day", value=len(self._watch.vehicles))
        raised = Counter(alarm.kind for alarm in self._watch.alarms)
        family = GaugeMetricFamily("station_alarms", "vehicles with an alarm", labels=["kind"])
        for kind in (SILENT, LOW_BATTERY):
            family.add_metric([kind], raised[kind])
        yield family


def histogram(name: str, text: str, values: Histogram) -> Metric:
    """A Prometheus histogram: cumulative counts up to each bound."""
    total, buckets = 0, []
    for bound, count in zip((*map(str, values.bounds), "+Inf"), values.counts, strict=True):
        total += count
        buckets.append((bound, total))
    return HistogramMetricFamily(name, text, buckets=buckets, sum_value=values.sum)


def exposition(collector: Collector) -> bytes:
    """The metrics in Prometheus's text format."""
    registry = CollectorRegistry(auto_describe=False)
    registry.register(collector)
    return generate_latest(registry)
