from __future__ import annotations

import os
import subprocess

from mavproxy_uavapi.core.process_tree import below, with_variable


def test_family_is_whoever_was_started_however_its_environment_is() -> None:
    shell = subprocess.Popen(
        ["sh", "-c", "env -i sleep 60 & echo; wait"],
        stdout=subprocess.PIPE,
        env={**os.environ, "A_VARIABLE_OF_THIS_TEST": "1"},
        start_new_session=True,
    )
    try:
        assert shell.stdout is not None
        shell.stdout.readline()
        assert shell.pid in with_variable("A_VARIABLE_OF_THIS_TEST")
        assert shell.pid not in with_variable("VARIABLE_OF_THIS_TEST")
        assert len(list(below(shell.pid))) == 1
    finally:
        os.killpg(shell.pid, 9)
        shell.communicate()
