"""How fast a vehicle's clock runs against ours, and when it started again. Pure."""

from __future__ import annotations

REBOOT_STEP_BACK = 3000  # ms; more than any reordering between two links, less than any boot takes
WINDOW = 5.0  # s of ours between two readings of the ratio
# GLOBAL_POSITION_INT's time is that of the position fix, which may run behind the boot time of others.
NOT_BOOT_TIME = {"GLOBAL_POSITION_INT"}


class TimeRatio:
    """Simulated seconds per second of ours: 1 for a real vehicle, about SIM_SPEEDUP for a simulated one.

    Measured from `time_boot_ms`, because a machine that cannot keep up makes SIM_SPEEDUP a promise only.
    """

    def __init__(self) -> None:
        self.ratio = 1.0
        self._boot_ms: int | None = None
        self._from: tuple[float, int] | None = None
        self._newest: tuple[float, int] | None = None

    def update(self, boot_ms: int | None, name: str, now: float) -> bool:
        """Take a message's `time_boot_ms`, arrived at `now` (s); whether it says that the vehicle rebooted."""
        if not boot_ms or name in NOT_BOOT_TIME:
            return False
        rebooted = self._boot_ms is not None and boot_ms + REBOOT_STEP_BACK < self._boot_ms
        if rebooted:
            self._from = None
        if rebooted or self._boot_ms is None or boot_ms > self._boot_ms:
            self._boot_ms = boot_ms
            self._newest = now, boot_ms
        self._measure(boot_ms, now)
        return rebooted

    def boot_time(self, now: float) -> float:
        """The vehicle's own clock at `now` (s of ours), in s since its boot; 0 before it told.

        Between two messages it is reckoned by the ratio.
        """
        if self._newest is None:
            return 0.0
        at, boot_ms = self._newest
        return boot_ms / 1000.0 + (now - at) * self.ratio

    def _measure(self, boot_ms: int, now: float) -> None:
        if self._from is None:
            self._from = now, boot_ms
            return
        at, start_ms = self._from
        if now - at >= WINDOW:
            self.ratio = max((boot_ms - start_ms) / 1000.0 / (now - at), 0.01)
            self._from = now, boot_ms
