from __future__ import annotations

import socket

from mavproxy_uavapi.launcher import instances, main


def test_two_runs_get_two_instances(tmp_path, monkeypatch):
    monkeypatch.setattr(instances, "ports_are_free", lambda instance: instance != 1)
    with instances.reserved(tmp_path, 0) as first, instances.reserved(tmp_path, 0) as second:
        assert (first, second) == (0, 2)
    with instances.reserved(tmp_path, 0) as again:
        assert again == 0


def test_every_instance_has_an_api_port_that_is_no_others():
    ports = [instances.api_port(number) for number in range(instances.HIGHEST + 1)]
    serial = {5760 + 10 * number + offset for number in range(100) for offset in instances.SERIAL_PORTS}
    assert len(set(ports) - serial) == 100


def test_port_in_use_is_not_free_and_the_launcher_says_so(capsys):
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        assert not instances.is_free(port)
        assert main(["--port", str(port)]) == 1
    assert f"127.0.0.1:{port} is taken" in capsys.readouterr().err
