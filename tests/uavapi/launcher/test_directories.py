from __future__ import annotations

from mavproxy_uavapi.core.state_directory import state_directory
from mavproxy_uavapi.launcher import directories
from mavproxy_uavapi.launcher.options import RunOptions


def test_run_directories_never_collide_and_are_private(tmp_path):
    first = directories.new_run(state_directory(), RunOptions())
    second = directories.new_run(state_directory(), RunOptions())
    assert first != second
    assert first.parent == second.parent == tmp_path / "state" / "mavproxy-uavapi" / "uav10"
    assert first.stat().st_mode & 0o777 == 0o700


def test_log_path_may_be_a_file_or_a_directory(tmp_path):
    assert directories.split_log_path(None, 1) == (state_directory(), None)
    assert directories.split_log_path(f"{tmp_path}/a/uav.log", 1) == (tmp_path / "a", f"{tmp_path}/a/uav.log")
    assert directories.split_log_path(f"{tmp_path}/a", 1) == (tmp_path / "a", f"{tmp_path}/a/uav_1.log")
