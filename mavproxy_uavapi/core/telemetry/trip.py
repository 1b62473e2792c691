"""How long a message takes to a vehicle and back, and what the vehicle's clock says of it. Pure.

Everything that is sent again depends on it: a heartbeat that arrives after a command may have left before the command
came. On a link of 1 s each way the acknowledgement arrives after 2 s, and a command that is sent again after 1.5 s
takes the vehicle from a pilot who has taken it in between.

The round trip is smoothed as TCP does it (RFC 6298): a deadline is the mean and four times the deviation. The clocks
are compared by TIMESYNC: the vehicle's time in an answer lies between our request and its arrival. So nobody need
assume that both ways take equally long.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

INITIAL = 1.0  # s; the deadline before the first measurement (RFC 6298, 2.1)
UNMEASURED = 6.0  # s; what counts as the longest trip to a vehicle that never answers: more than a satellite's
SHARE, DEVIATION_SHARE, DEVIATIONS = 1 / 8, 1 / 4, 4.0  # alpha, beta and K there
GRAIN = 0.05  # s; the least that is added to the mean: a main loop's turn, and the vehicle's
LONGEST = 30.0  # s; no link is slower
SLOWEST_KEPT = 12  # measurements: a deadline is no shorter than the slowest of these
FORGOTTEN = 30.0  # s after which a request is not answered any more
KEPT = 20  # comparisons of the clocks, the newest; the quickest of them is the most exact
TWICE, TWICE_WITHIN = 3, 10.0  # requests answered by two clocks, and s, after which there are two autopilots
SAME_PACE = 0.02  # a vehicle's clock that runs this much faster or slower than ours is a simulator's


@dataclass(frozen=True)
class Comparison:
    """An answered TIMESYNC: when it was sent and answered (s of ours), and the vehicle's clock meanwhile (s)."""

    sent_at: float
    answered_at: float
    vehicle_time: float

    @property
    def trip(self) -> float:
        """s there and back."""
        return self.answered_at - self.sent_at


class Trip:
    """The round trip to one vehicle, and its clock.

    Attributes:
        mean: s; None before the first measurement.
    """

    def __init__(self) -> None:
        self.mean: float | None = None
        self._deviation = 0.0
        self._slowest: deque[float] = deque(maxlen=SLOWEST_KEPT)
        self._asked: dict[int, float] = {}  # when, by the time that the request names (ns)
        self._comparisons: deque[Comparison] = deque(maxlen=KEPT)
        self._answered: dict[int, tuple[float, float]] = {}  # when, and the vehicle's clock then (s), by request
        self._answered_twice: deque[float] = deque(maxlen=TWICE)  # s

    @property
    def deadline(self) -> float:
        """s from a sending after which its answer has arrived, or never will."""
        if self.mean is None:
            return INITIAL
        smoothed = self.mean + max(DEVIATIONS * self._deviation, GRAIN)
        return min(max(smoothed, max(self._slowest) + GRAIN), LONGEST)

    def at_least(self, seconds: float) -> float:
        """s to wait for an answer: so many, and more on a slow link."""
        return max(seconds, self.deadline)

    def measured(self, seconds: float) -> None:
        """An answer came so many s after its request, which was sent once (Karn)."""
        self._slowest.append(seconds)
        if self.mean is None:
            self.mean, self._deviation = seconds, seconds / 2
            return
        self._deviation += DEVIATION_SHARE * (abs(self.mean - seconds) - self._deviation)
        self.mean += SHARE * (seconds - self.mean)

    @property
    def longest(self) -> float:
        """s after which a message has arrived, or is lost, where no clock shows it."""
        return max(self.deadline, UNMEASURED) if self.mean is None else self.deadline

    # -- clocks -------------------------------------------------------------------------------------------

    def ask(self, now: float) -> int:
        """Note that a TIMESYNC goes out at `now` (s); its `ts1`, ns."""
        self._asked = {name: at for name, at in self._asked.items() if now - at <= FORGOTTEN}
        name = int(now * 1e9)
        self._asked[name] = now
        return name

    def answer(self, name: int, vehicle_time: float, now: float, ratio: float = 1.0) -> None:
        """An answer to `ask` arrived at `now` (s); `vehicle_time`: the vehicle's clock, s since its boot.

        Links may double what is sent either way. The answers of one clock are no further apart than the times from
        the request to their arrivals, however long each is on its way. `ratio`: as for `arrived_by`.
        """
        sent_at = self._asked.pop(name, None)
        if not math.isfinite(vehicle_time):
            return
        if sent_at is None:
            if name not in self._answered:
                return
            asked_at, (at, clock) = name / 1e9, self._answered.pop(name)
            pace = max(ratio, 1.0)  # of a link that doubles it is measured badly
            if not pace * (asked_at - at) - GRAIN <= vehicle_time - clock <= pace * (now - asked_at) + GRAIN:
                self._answered_twice.append(now)
            return
        self._answered = {one: answer for one, answer in self._answered.items() if now - answer[0] <= FORGOTTEN}
        self._answered[name] = now, vehicle_time
        if self._comparisons and vehicle_time < self._comparisons[-1].vehicle_time - LONGEST:
            self.forget_clock()  # it has booted
        self.measured(now - sent_at)
        self._comparisons.append(Comparison(sent_at, now, vehicle_time))

    def is_answered_twice(self, now: float) -> bool:
        """Whether each request is answered by two clocks: two autopilots have one system id."""
        return len(self._answered_twice) == TWICE and now - self._answered_twice[0] <= TWICE_WITHIN

    def forget_clock(self) -> None:
        """The vehicle has booted: its clock begins anew."""
        self._comparisons.clear()

    @property
    def knows_clock(self) -> bool:
        """Whether the vehicle's clock is known."""
        return bool(self._comparisons)

    def _best(self, ratio: float) -> Comparison:
        """The comparison to count from: the quickest one; of a clock that runs unlike ours the newest."""
        if abs(ratio - 1.0) > SAME_PACE:
            return self._comparisons[-1]
        return min(self._comparisons, key=lambda one: one.trip)

    def arrived_by(self, sent_at: float, ratio: float = 1.0) -> float:
        """The vehicle's clock (s) by which a message that we sent at `sent_at` (s) has arrived, or is lost.

        A question for the clock that was sent later, and was answered, arrived later, too, unless it has overtaken
        the message. An older measurement does not tell how long the link takes now. Infinite before such an answer.

        Args:
            sent_at: s of ours.
            ratio: s of the vehicle's clock in a second of ours.
        """
        later = [one for one in self._comparisons if one.sent_at >= sent_at]
        if not later:
            return math.inf
        first = min(later, key=lambda one: one.vehicle_time)
        overtaking = max(self.deadline - min(one.trip for one in self._comparisons), GRAIN) - GRAIN
        return first.vehicle_time + max(overtaking - (first.sent_at - sent_at), 0.0) * ratio

    def time_at(self, at: float, ratio: float = 1.0) -> float:
        """The vehicle's clock (s) at `at` (s of ours); it may be later by a trip, never earlier."""
        best = self._best(ratio)
        return best.vehicle_time + (at - best.answered_at) * ratio
