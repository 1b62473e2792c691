"""The MQTT sink with a real Mosquitto, on the loopback and with a configuration of its own."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.support.ports import free_port
from tests.support.processes import Rig

MOSQUITTO = shutil.which("mosquitto", path="/usr/sbin:/usr/bin:/usr/local/sbin:/usr/local/bin:/opt/homebrew/sbin")

pytestmark = [pytest.mark.needs("mosquitto"), pytest.mark.long]
mqtt = pytest.importorskip("paho.mqtt.client")


class Broker:
    """A Mosquitto with a user and a password."""

    def __init__(self, rig: Rig, harness: Any, directory: Path, *lines: str) -> None:
        self._rig, self._harness, self._directory = rig, harness, directory
        self.port = free_port()
        passwords = directory / "passwords"
        maker = (
            shutil.which("mosquitto_passwd", path="/usr/bin:/usr/local/bin:/opt/homebrew/bin") or "mosquitto_passwd"
        )
        subprocess.run([maker, "-b", "-c", str(passwords), "uav", "secret"], check=True, capture_output=True)
        passwords.chmod(0o644)
        directory.chmod(0o755)
        self._config = directory / "mosquitto.conf"
        self._config.write_text(
            f"listener {self.port} 127.0.0.1\nallow_anonymous false\npassword_file {passwords}\nuser root\n"
            + "".join(f"{line}\n" for line in lines)
        )
        self.start()

    def start(self) -> None:
        assert MOSQUITTO is not None
        self._process = self._rig.start("mosquitto", [MOSQUITTO, "-c", str(self._config), "-v"])
        self._harness.eventually(lambda: "running" in self._process.output(), what="the broker's start")

    def stop(self) -> None:
        self._process.stop()
        self._process.log.unlink()


class Subscriber:
    """Hears all that the broker has; `heard` is (topic, payload, retained)."""

    def __init__(self, port: int, topic: str = "fleet/#", ca_file: Path | None = None) -> None:
        self.heard: list[tuple[str, Any, bool]] = []
        self._subscribed = threading.Event()
        self._client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
        self._client.username_pw_set("uav", "secret")
        if ca_file is not None:
            self._client.tls_set(str(ca_file))
        self._client.on_message = self._take
        self._client.on_subscribe = lambda *_: self._subscribed.set()
        self._client.on_connect = lambda *_: self._client.subscribe(topic, qos=1)
        self._client.connect("127.0.0.1", port)
        self._client.loop_start()
        assert self._subscribed.wait(10)

    def _take(self, _client: Any, _data: Any, message: Any) -> None:
        self.heard.append((message.topic, message.payload.decode(), message.retain))

    def readings(self, topic: str) -> list[dict[str, Any]]:
        return [json.loads(payload) for heard, payload, _ in list(self.heard) if heard == topic]

    def stop(self) -> None:
        self._client.disconnect()
        self._client.loop_stop()


@pytest.fixture
def rig(harness, tmp_path_factory) -> Iterator:
    made = harness.embedded(tmp_path_factory.mktemp("mqtt"), "--sysid=10", speedup=1)
    yield made
    made.stop()


def test_readings_positions_and_the_last_will(rig, harness, tmp_path):
    broker = Broker(rig, harness, tmp_path)
    subscriber = Subscriber(broker.port)
    sink = f"mqtt://uav:secret@127.0.0.1:{broker.port}/fleet/{{sysid}}/{{quantity}}"
    rig.mavproxy.ask(f'module load gradys:{{"spool":"{tmp_path}/spool.db"}}', "Loaded module gradys")
    rig.mavproxy.ask(f"gradys set sink {sink}", "gradys: no ground station")
    harness.eventually(lambda: len(subscriber.readings("fleet/10/position")) >= 3, what="three positions")
    assert ("fleet/10/status", "online", False) in subscriber.heard
    assert "secret" not in rig.mavproxy.ask("gradys status", "sink mqtt://uav:***@")

    late = Subscriber(broker.port)  # a new subscriber has the last position and the status at once
    harness.eventually(lambda: len(late.heard) >= 2, what="what is retained")
    retained = {topic for topic, _, kept in late.heard if kept}
    assert retained == {"fleet/10/position", "fleet/10/status"}
    late.stop()

    numbers = []
    broker.stop()
    for value in range(50):
        numbers += rig.ok(rig.post("/gradys/readings", quantity="temperature", value=value))["seq"]
    harness.eventually(lambda: _sink(rig)["last_error"], what="the broker's being missed")
    subscriber.stop()
    # No reading is retained: those that came before the subscription would be heard by nobody.
    rig.mavproxy.popen.send_signal(signal.SIGSTOP)
    broker.start()
    subscriber = Subscriber(broker.port)
    rig.mavproxy.popen.send_signal(signal.SIGCONT)
    rig.mavproxy.ask("gradys flush", "tried now")
    harness.eventually(lambda: len(subscriber.readings("fleet/10/temperature")) >= 50, what="all fifty")
    seen = list(dict.fromkeys(reading["seq"] for reading in subscriber.readings("fleet/10/temperature")))
    assert seen == numbers

    rig.mavproxy.popen.send_signal(signal.SIGKILL)
    harness.eventually(lambda: ("fleet/10/status", "offline", False) in subscriber.heard, what="the last will")
    subscriber.stop()


def test_unloading_says_offline(rig, harness, tmp_path):
    broker = Broker(rig, harness, tmp_path)
    subscriber = Subscriber(broker.port)
    sink = f"mqtt://uav:secret@127.0.0.1:{broker.port}"
    settings = json.dumps({"sink": sink, "spool": f"{tmp_path}/spool.db"}, separators=(",", ":"))
    rig.mavproxy.ask(f"module load gradys:{settings}", "Loaded module gradys")
    harness.eventually(lambda: subscriber.readings("fleet/uav-10/position"), what="a position")
    rig.mavproxy.ask("module unload gradys", "Unloaded module gradys")
    harness.eventually(lambda: ("fleet/uav-10/status", "offline", False) in subscriber.heard, what="offline")
    subscriber.stop()


def test_a_wrong_password_is_reported(rig, harness, tmp_path):
    broker = Broker(rig, harness, tmp_path)
    sink = f"mqtt://uav:wrong@127.0.0.1:{broker.port}/fleet/{{sysid}}/{{quantity}}"
    settings = json.dumps({"sink": sink, "spool": f"{tmp_path}/spool.db"}, separators=(",", ":"))
    rig.mavproxy.ask(f"module load gradys:{settings}", "Loaded module gradys")
    error = harness.eventually(lambda: _sink(rig)["last_error"], what="the refusal")
    assert "Not authorized" in error and "wrong" not in error
    rig.mavproxy.ask("module unload gradys", "Unloaded module gradys")


@pytest.mark.needs("openssl")
def test_tls_is_checked_by_the_ca_file(rig, harness, tmp_path):
    key, cert = tmp_path / "key.pem", tmp_path / "cert.pem"
    make = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=broker"]
    make += ["-addext", "subjectAltName=IP:127.0.0.1", "-keyout", str(key), "-out", str(cert)]
    subprocess.run(make, check=True, capture_output=True)
    broker = Broker(rig, harness, tmp_path, f"certfile {cert}", f"keyfile {key}")
    subscriber = Subscriber(broker.port, ca_file=cert)
    sink = f"mqtts://uav:secret@127.0.0.1:{broker.port}/fleet/{{sysid}}/{{quantity}}"
    settings = json.dumps({"sink": sink, "spool": f"{tmp_path}/spool.db"}, separators=(",", ":"))
    rig.mavproxy.ask(f"module load gradys:{settings}", "Loaded module gradys")
    error = harness.eventually(lambda: _sink(rig)["last_error"], what="a certificate that nobody vouches for")
    assert "certificate" in error.lower()
    assert subscriber.heard == []
    rig.mavproxy.ask(f"gradys set ca_file {cert}", "gradys: no ground station")
    rig.mavproxy.ask("gradys flush", "tried now")
    harness.eventually(lambda: len(subscriber.readings("fleet/10/position")) >= 3, what="three positions")
    subscriber.stop()
    rig.mavproxy.ask("module unload gradys", "Unloaded module gradys")


def _sink(rig: Rig) -> dict[str, Any]:
    answer = rig.get("/gradys/status")
    if answer.status_code == 404:  # the module begins a moment after it is loaded
        return {"last_error": None}
    sinks = rig.ok(answer)["info"]["sinks"]
    return dict(sinks[0]) if sinks else {"last_error": None}


def test_a_vehicle_of_another_mavproxy_that_comes_near_is_reported_at_the_prompt(rig, harness, tmp_path):
    broker = Broker(rig, harness, tmp_path)
    rig.mavproxy.ask(f'module load gradys:{{"spool":"{tmp_path}/spool.db"}}', "Loaded module gradys")
    rig.mavproxy.ask("uavapi set separation 8", "")
    rig.in_the_air(10)
    mark = rig.mavproxy.mark()
    rig.mavproxy.type(f"gradys set hear mqtt://uav:secret@127.0.0.1:{broker.port}")
    harness.eventually(lambda: "fleet/+/position" in broker._process.output(), what="the subscription")
    here = rig.ok(rig.get("/telemetry/gps"))["info"]["position"]
    client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
    client.username_pw_set("uav", "secret")
    client.connect("127.0.0.1", broker.port)
    client.loop_start()
    for device, metres in (("uav-10", 1), ("uav-7", 60), ("uav-8", 5)):  # ourselves, far away, near
        value = [here["lat"] + metres / 111_000, here["lon"], 10.0]
        reading = {"device": device, "quantity": "position", "value": value, "time": time.time()}
        client.publish("fleet/x/position", json.dumps(reading), qos=1).wait_for_publish(5)
    said = rig.mavproxy.says("*** uav-8 of another MAVProxy comes within 5 m of uav-10, over the ground", mark)
    client.loop_stop()
    client.disconnect()
    assert "*** uav-8 of another MAVProxy comes within 5 m of uav-10, over the ground" in said
    assert "uav-7" not in said
    assert "secret" not in rig.mavproxy.ask("gradys config", "spool_hours")
