"""The directory of a run's telemetry logs and output; never the current directory."""

from __future__ import annotations

import time
from pathlib import Path

from mavproxy_uavapi.core.state_directory import state_directory
from mavproxy_uavapi.launcher.options import RunOptions


def split_log_path(log_path: str | None, sysid: int) -> tuple[Path, str | None]:
    """The directory for the runs, and the API's log file if `--log_path` names one.

    The original service took a file; a path without a suffix, or of an existing directory, is the directory for both.
    """
    if log_path is None:
        return state_directory(), None
    path = Path(log_path).expanduser().absolute()
    if path.suffix and not path.is_dir() or path.is_file():
        return path.parent, str(path)
    return path, str(path / f"uav_{sysid}.log")


def new_run(root: Path, options: RunOptions) -> Path:
    """Make a new directory for this run, readable only by its user: `uav<sysid>/<date>-<time>`."""
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
