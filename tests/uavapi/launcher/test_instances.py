from __future__ import annotations

import contextlib
import socket
import subprocess
import sys

from mavproxy_uavapi.launcher import instances, main


def test_launchers_of_other_state_directories_get_other_instances(monkeypatch):
    imports = "from mavproxy_uavapi.launcher.instances import reserved"
    take = f"{imports}\nwith reserved(60) as number:\n    print(number, flush=True)\n    input()"
    with contextlib.ExitStack() as stack:
        other = stack.enter_context(
            subprocess.Popen([sys.executable, "-c", take], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        )
        first = int(other.stdout.readline())
        monkeypatch.setattr(instances, "ports_are_free", lambda instance: instance != first + 1)
        with instances.reserved(first) as second, instances.reserved(first) as third:
            assert len({first, second, third}) == 3 and min(second, third) > first
            assert first + 1 not in (second, third)
        other.stdin.close()
        other.wait()
        with instances.reserved(first) as again:
            assert again == first


def test_port_in_use_is_not_free_and_the_launcher_says_so(capsys):
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        assert not instances.is_free(port)
        assert main(["--port", str(port)]) == 1
    assert f"127.0.0.1:{port} is taken" in capsys.readouterr().err
