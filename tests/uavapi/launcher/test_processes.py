from __future__ import annotations

import os
import signal
import subprocess
import sys

from mavproxy_uavapi.launcher import processes


def test_a_strangers_process_is_no_member_even_in_our_session():
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as stranger:
        assert not processes.signal_member(stranger.pid, signal.SIGKILL, "tag", {os.getsid(0)})
        assert stranger.poll() is None
        stranger.kill()
