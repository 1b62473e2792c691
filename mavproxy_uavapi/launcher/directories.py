"""Where a run keeps its telemetry logs and output: never the current directory."""

from __future__ import annotations

import time
from pathlib import Path

from mavproxy_uavapi.core.state_directory import state_directory
from mavproxy_uavapi.launcher.options import RunOptions


def split_log_path(log_path: str | None, sysid: int) -> tuple[Path, str | None]:
    """The directory for the runs, and the API's log file where `--log_path` asks for one.

    The original service took a file there; a path without a suffix, or of an existing directory, is taken
    for the directory of both.
    """
    if log_path is None:
        return state_directory(), None
    given = Path(log_path).expanduser().absolute()
    if given.suffix and not given.is_dir() or given.is_file():
        return given.parent, str(given)
    return given, str(given / f"uav_{sysid}.log")


def new_run(root: Path, options: RunOptions) -> Path:
    """Make a fresh directory for this run, readable by its user only: `uav<sysid>/<date>-<time>`."""
    started = time.strftime("%Y%m%d-%H%M%S")
    for attempt in range(1, 1000):
        name = started if attempt == 1 else f"{started}-{attempt}"
        run_dir = root / f"uav{options.sysid}" / name
        try:
            run_dir.mkdir(parents=True, mode=0o700)
        except FileExistsError:
            continue
        return run_dir
    raise FileExistsError(f"{root} holds 999 runs of this second")
