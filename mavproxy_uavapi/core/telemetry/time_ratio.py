"""How fast a vehicle's clock runs against ours, and when it started again. Pure."""

from __future__ import annotations

REBOOT_STEP_BACK = 3000  # ms; more than any reordering between two links, less than any boot takes
WRAP = 2**32  # ms; `time_boot_ms` wraps to 0 after 49.7 days
WRAP_SLACK = 60_000  # ms by which the vehicle's clock may run ahead of ours over a wrap
WINDOW = 5.0  # s of ours between two readings of the ratio
# GLOBAL_POSITION_INT's time is that of the position fix, which may run behind the boot time of others.
NOT_BOOT_TIME = {"GLOBAL_POSITION_INT"}


class TimeRatio:
    """Simulated seconds per second of ours: 1 for a real vehicle, about SIM_SPEEDUP for a simulated one.

    Measured from `time_boot_ms`, because a slow machine does not reach SIM_SPEEDUP.
    """

    def __init__(self) -> None:
        self.ratio = 1.0
        self._from: tuple[float, int] | None = None
        self._newest: tuple[float, int] | None = None  # arrival (s), ms since the boot including wraps

    def update(self, boot_ms: int | None, name: str, now: float) -> bool:
        """Take a message's `time_boot_ms`, arrived at `now` (s); whether it shows a reboot."""
        if not boot_ms or name in NOT_BOOT_TIME:
            return False
        uptime = self._uptime(boot_ms, now)
        rebooted = self._newest is not None and uptime + REBOOT_STEP_BACK < self._newest[1]
        if rebooted:
            self._from = None
        if rebooted or self._newest is None or uptime > self._newest[1]:
            self._newest = now, uptime
        self._measure(uptime, now)
        return rebooted

    def _uptime(self, boot_ms: int, now: float) -> int:
        """The ms since the boot, including wraps.

        A time that steps back has wrapped if the clock would have reached it by now; else it shows a reboot. A
        message from before a wrap may arrive after one from behind it.
        """
        if self._newest is None:
            return boot_ms
        at, newest = self._newest
        ahead = (boot_ms - newest) % WRAP
        if ahead <= (now - at) * 1000 * max(self.ratio, 1.0) + WRAP_SLACK:
            return newest + ahead
        if WRAP - ahead <= REBOOT_STEP_BACK and newest > WRAP:
            return newest + ahead - WRAP
        return boot_ms

    def boot_time(self, now: float) -> float:
        """The vehicle's own clock at `now` (s of ours), in s since its boot; 0 while unknown.

        Between two messages it is extrapolated by the ratio.
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
