"""How fast a vehicle's clock runs against ours, and when it started again. Pure."""

from __future__ import annotations

import math

REBOOT_STEP_BACK = 3000  # ms; more than any reordering between two links, less than any boot takes
WRAP = 2**32  # ms; `time_boot_ms` wraps to 0 after 49.7 days
WRAP_SLACK = 60_000  # ms by which the vehicle's clock may run ahead of ours over a wrap
LATE = 3.0  # s by which a message may be overtaken
TWO_CLOCKS_FOR = 10.0  # s after which a second clock that is silent counts as gone
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
        self._before: tuple[float, int] | None = None  # likewise, before the newest boot
        self._leapt: tuple[float, int] | None = None  # the first of times that no clock could have reached
        self._returned_since: float | None = None  # s; since when messages of the clock before a boot come
        self._two_clocks_at = -math.inf  # s; when the newest of them came

    def update(self, boot_ms: int | None, name: str, now: float, overtaken: float = 0.0) -> bool:
        """Take a message's `time_boot_ms`, arrived at `now` (s); whether it shows a reboot.

        `overtaken`: s by which a newer message may have come before it.
        """
        if not boot_ms or name in NOT_BOOT_TIME:
            return False
        uptime = self._uptime(boot_ms, now)
        step_back = max(REBOOT_STEP_BACK, 1000 * overtaken)
        rebooted = self._newest is not None and uptime + step_back < self._newest[1]
        if rebooted:
            self._from, self._before, self._returned_since = None, self._newest, None
        elif self._before is not None and self._newest is not None and self._goes_on(self._before, boot_ms, now):
            if now - self._newest[0] > TWO_CLOCKS_FOR:  # the newer clock is gone: this one is the vehicle's
                self._from, self._newest, self._before = None, (now, boot_ms), None
                return False
            self._before = now, boot_ms
            self._returned_since = now if self._returned_since is None else self._returned_since
            both_come = now - self._newest[0] <= LATE
            if both_come and self._newest[0] - self._returned_since >= LATE:  # longer than any message is overtaken
                self._two_clocks_at = now
            return False
        elif self._leaps(uptime, now):
            return False
        elif self._before is not None and uptime + step_back >= self._expected(self._before, now):
            self._before = None  # it is the clock before: the newer one is gone
        if rebooted or self._newest is None or uptime > self._newest[1]:
            self._newest = now, uptime
        self._measure(uptime, now)
        return rebooted

    def _leaps(self, uptime: int, now: float) -> bool:
        """Whether the clock cannot have reached that time. It is another clock's if it goes on for a while."""
        if self._newest is None or now - self._newest[0] > LATE or self.can_be(uptime, now):
            return False
        at, first = self._leapt or (now, uptime)
        goes_on = abs(uptime - first - (now - at) * 1000 * self.ratio) < REBOOT_STEP_BACK / 2
        if goes_on and now - at >= LATE:
            self._leapt = None
            return False
        self._leapt = (at, first) if goes_on else (now, uptime)
        return True

    def can_be(self, uptime: int, now: float) -> bool:
        """Whether the clock can have reached that time (ms) by now."""
        if self._newest is None:
            return True
        at, newest = self._newest
        return uptime - newest <= (now - at) * 1000 * max(self.ratio, 1.0) + WRAP_SLACK

    def has_two_clocks(self, now: float) -> bool:
        """Whether messages of two clocks come: two autopilots have one system id."""
        return now - self._two_clocks_at <= TWO_CLOCKS_FOR

    def _goes_on(self, clock: tuple[float, int], boot_ms: int, now: float) -> bool:
        """Whether a time goes on where that clock was, and not where the newer one is."""
        if self._newest is None or now - clock[0] > TWO_CLOCKS_FOR:
            return False
        ahead = boot_ms - self._newest[1]
        return abs(boot_ms - self._expected(clock, now)) < REBOOT_STEP_BACK / 2 < ahead

    def _expected(self, clock: tuple[float, int], now: float) -> float:
        """What a clock shows now (ms) that was read before."""
        at, before = clock
        return before + (now - at) * 1000 * self.ratio

    def _uptime(self, boot_ms: int, now: float) -> int:
        """The ms since the boot, including wraps.

        A time that steps back has wrapped if the clock would have reached it by now; else it shows a reboot. A
        message from before a wrap may arrive after one from behind it.
        """
        if self._newest is None:
            return boot_ms
        newest = self._newest[1]
        ahead = (boot_ms - newest) % WRAP
        if self.can_be(newest + ahead, now):
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
