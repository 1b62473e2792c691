"""Where vehicles would end if now their link or their GPS were lost: twins of them fly on alone from here."""

from __future__ import annotations

import gc
import json
import math
import os
import signal
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from mavproxy_uavapi.launcher.errors import LaunchError
from mavproxy_uavapi.rehearsal.record import LOSSES, Loss, Record, Sample
from mavproxy_uavapi.rehearsal.truth import VehicleTruth
from mavproxy_uavapi.sim.simulator import Simulator

EVERY, SHARE = 10.0, 24  # s of the clock from one moment to the next; in a long flight a share of it
AT_ONCE = 2  # processes beside ours
FLIES_ON = 600.0  # s of its clock, at most
AT_REST = 0.1  # m/s: slower than this a twin stands still
STANDS_STILL = 20.0  # s after which it is taken that it stays there; ArduPilot's failsafes act sooner
FAILSAFES_WITHIN = ("FS_GCS_TIMEOUT", "FS_TIMEOUT", "FS_LONG_TIMEOUT")  # s after which a lost link may act
ACTS = 10.0  # s later it has


class Twins:
    """The twins of one flight's vehicles: each is a copy of this process, which leaves a file when it has ended.

    Args:
        folder: for those files.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._twins: list[tuple[Sample, VehicleTruth, str, Path]] = []  # from where, whose, what is lost, its file
        self._processes: list[int] = []
        self._next: dict[int, float] = {}  # by system id, on its clock

    def look(self, truths: Sequence[VehicleTruth], record: Record) -> None:
        """Have some fly on from here, if it is time.

        Raises:
            LaunchError: there can be no more processes.
        """
        for truth in truths:
            now = record.samples[truth.system][-1]
            if now.is_under_way and now.at >= self._next.get(truth.system, 0.0):
                self._next[truth.system] = now.at + max(EVERY, now.at / SHARE)
                for what in LOSSES:
                    file = self._folder / f"twin-{truth.system}-{what}-{now.at:.2f}.json"
                    self._wait(AT_ONCE - 1)
                    self._processes.append(_forked(truth, what, file))
                    self._twins.append((now, truth, what, file))

    def _wait(self, most: int) -> None:
        """Until so many fly at most. The clock stands meanwhile."""
        while len(self._processes) > most:
            os.waitpid(self._processes.pop(0), 0)

    def kill(self) -> None:
        """End those that fly; nothing comes of them."""
        for process in self._processes:
            os.kill(process, signal.SIGKILL)
        self._wait(0)

    def end(self, record: Record) -> None:
        """Begin no more, wait for those that fly, and note where they have ended.

        Raises:
            LaunchError: one has failed.
        """
        self._wait(0)
        for begin, truth, what, file in self._twins:
            if not file.exists():
                raise LaunchError(f"where vehicle {truth.system} would end without its {what} could not be found out")
            told = json.loads(file.read_text(encoding="ascii"))
            end = Sample(*told) if told else record.samples[truth.system][-1]
            record.losses.append(
                Loss(begin.at, truth.system, what, *end[1:4], end.mode, end.armed, round(end.at - begin.at, 2))
            )


def _forked(truth: VehicleTruth, what: str, file: Path) -> int:
    try:
        child = os.fork()
    except OSError as error:
        raise LaunchError(f"there can be no more processes: {error.strerror}") from error
    if not child:
        _fly_on(truth, what, file)
    return child


def _fly_on(truth: VehicleTruth, what: str, file: Path) -> NoReturn:
    """Be a twin: leave where it ends, or nothing if its mission goes on as it did."""
    try:
        gc.disable()  # it would copy all that it looks at
        file.write_text(json.dumps(_end(truth, what)), encoding="ascii")
    except BaseException:  # noqa: BLE001  what the copied process would do next is the rehearsal's
        traceback.print_exc()
    finally:
        os._exit(0)


def _end(truth: VehicleTruth, what: str) -> Sample | None:
    """Where it is disarmed, stands still, or is after `FLIES_ON` s; None if it flies its mission as with its link."""
    simulator = truth.simulator
    assert isinstance(simulator, Simulator), "SITL has no twins"
    vehicle, flown = simulator.vehicle, simulator.vehicle.mode
    truth.tell({"op": "fault", "name": LOSSES[what]})
    simulator.links.clear()  # nobody hears it
    begin = moved_at = vehicle.now
    acts = ACTS + max(simulator.parameters.get(name, 0.0) for name in FAILSAFES_WITHIN)
    while vehicle.armed and vehicle.now < min(begin + FLIES_ON, moved_at + STANDS_STILL):
        simulator.run(1.0)
        if math.hypot(*vehicle.body.velocity) > AT_REST:
            moved_at = vehicle.now
        if what == "link" and vehicle.mode is flown is vehicle.mission_mode and vehicle.now > begin + acts:
            return None
    return truth.sample()
