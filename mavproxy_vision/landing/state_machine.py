"""The landing as a state machine: time, motion and target in, velocity and phase out. Pure.

    LOOK -> DESCEND -> LAST_METRE -> (done: land)
      ^       | lost for 0.5 s, above BLIND_BELOW: HOLD -> 2 s: CLIMB -> LOOK -> SEARCH -> … -> (failed)
      |       | lost below BLIND_BELOW: LAST_METRE anyway

Each phase has an end of its own: the descent ends by a time that its height gives, when the vehicle has sunk as far
as the tag was below, and when it stands. What it then stands on is not the tag. So does a search that sinks into a
hill.

The last metre is flown by the tag's last position and the vehicle's motion since, because the autopilot's LAND holds
a position that drifts with its GPS.

An attempt is one search: first in place, then along one more ring of the expanding square each.
Times are on the vehicle's clock (s), velocities m/s NED, places m NED in the frame of `Motion.travelled`.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mavproxy_vision.geometry.frames import Vector, limited, vector
from mavproxy_vision.landing.expanding_square import Waypoint, expanding_square
from mavproxy_vision.landing.plan import Plan
from mavproxy_vision.tracking.pose_history import Motion
from mavproxy_vision.tracking.target_filter import COAST, Target

HOLD = 2.0  # s without a detection until it climbs
BLIND_BELOW = 1.0  # m: below this the landing goes on even if the tag is lost
CLIMB = 1.5  # m above the last measurement
GAIN = 0.9  # 1/s: velocity for each m of offset
INTEGRAL = 0.15  # 1/s/s
INTEGRAL_LIMIT = 0.25  # m/s
VERTICAL_GAIN = 0.8  # 1/s
CONE = ((3.0, math.radians(20)), (1.0, math.radians(10)))  # height (m) and half angle: wide high up, narrow low
SLOWDOWN = (0.20, 0.45)  # descent rate: m/s, and 1/s of the height
SLOWEST = 0.15  # m/s of descent
CENTRING = 20.0  # s that a descent may take beyond the time that it takes at SLOWEST
BENEATH = 0.5  # m below where the tag was when the descent began, that it may sink at most
STANDS = 2.0  # s for which it must have been told to sink, and does not, until it counts as standing …
STANDS_BELOW = 1.0  # m … at this height by its own estimate, and below
STANDS_SINKING = 0.05  # m/s
SOFTLY = 0.45  # m/s, at most, below STANDS_BELOW by its own estimate, until the last metre: less than LAND's
LAST_DESCENT = 0.35  # m/s on the last metre
LAST_GAIN = 1.8  # 1/s: no camera latency affects the last metre
LAST_SPEED = 0.4  # m/s, horizontally there
TOUCH = 0.2  # m above the target below which the autopilot's LAND is not interrupted
LATE = 1.0  # s beyond the expected end of the last metre: it already stands, on higher legs
LAG = 0.4  # s from a setpoint to the vehicle's velocity
HEAVES = 0.6  # m/s up or down of a pad, at most: a swell of 0.5 m in 6 s has 0.52
SWELL = 1.5  # m that a pad that moves may sink
NEAR_PAD = 0.4  # m above a pad that moves, below which …
TOUCHES = 0.3  # s without sinking are a touchdown
SEEN = 1.4  # times the height of the last metre, below which such a pad must have been seen …
OFF_PAD = 0.25  # … and m from it, within which a vehicle that stands is on it
MISSED = 0.3  # m below such a pad's foretold height, at which it has missed it, and LAND would fall
FOLLOWS = 2.5  # s without sight of such a pad until it no longer follows it, but stays
NEAR = 0.4  # m from a waypoint that count as arrived
CENTRES = 1.5  # times the height of the last metre, below which it does not sway, but for a tag that is not tried
SETTLES = 1.0  # s for which a tag that moves must be in sight until its velocity is known for the last metre
NEARLY = 0.3  # m beside such a tag, within which the last metre may begin without sight of it
LED = 2.0  # leashes away from where it began, to which it follows a tag that its sway has not tried
STEP_TIME = 0.2  # longest time between two steps that counts, s


class Phase(enum.Enum):
    """The activity of the landing."""

    LOOK = "looking"
    DESCEND = "descending"
    HOLD = "holding: tag lost"
    CLIMB = "climbing to the last fix"
    SEARCH = "searching"
    LAST_METRE = "descending the last metre"
    LAND = "touching down"
    FAILED = "failed"


@dataclass(frozen=True)
class LandingCommand:
    """The present command: phase, velocity (m/s NED), and the reason of a failure."""

    phase: Phase
    velocity: Vector
    reason: str = ""


REST = vector(0.0, 0.0, 0.0)


class Landing:
    """One landing, or one search."""

    def __init__(self, plan: Plan, target: Target) -> None:
        self.plan, self.target = plan, target
        self.phase = Phase.LOOK
        self.attempt = 0
        self.refused = False  # failed because the detections are implausible
        self.stands = False  # failed because it stands on the ground
        self.offset: float | None = None  # m, horizontally, at the last detection
        self.began: float | None = None
        self.phases: dict[str, float] = {}  # s that each phase took
        self._since = 0.0
        self._last_step: float | None = None
        self._velocity = REST
        self._integral: Vector = np.zeros(2)
        self._home: Vector = REST  # where it began
        self._anchor: Vector = REST  # where it holds, to which it climbs, or from which it searches
        self._height = 0.0  # the height above the ground that it holds there, m
        self._corners: Iterator[Waypoint] = iter(())
        self._corner: Waypoint | None = None
        self._descended_by = self._down_by = math.inf  # when the descent, and the last metre, should be over
        self._bottom = math.inf  # m down, to which it sinks at most
        self._roof = -math.inf  # m down, to which a search climbs at most, whatever its height seems to be
        self._sinking_at = -math.inf  # when it last sank, or was not told to
        self._falling_at = -math.inf  # when it last sank towards a pad that moves, or was not near it
        self._reason = ""
        self._flies = False  # whether its land detector has said so, since it began

    def step(self, now: float, motion: Motion, height: float, landed: bool = False) -> LandingCommand:
        """One step.

        Args:
            now: vehicle time, s.
            motion: of the vehicle now.
            height: above the target's ground by its own estimate, m.
            landed: whether its land detector says that it stands.
        """
        if self.began is None:
            self.begin(now)
        if self._last_step is None:
            self._start_from(now, motion, height)
        assert self._last_step is not None
        elapsed = min(max(now - self._last_step, 0.0), STEP_TIME)
        self._last_step = now
        self.phases[self.phase.value] = self.phases.get(self.phase.value, 0.0) + elapsed
        failure = self._failure(now, motion)
        if failure:
            return self.fail(failure)
        if self.phase in (Phase.DESCEND, Phase.LAST_METRE):
            if landed or self._stands(now, motion, height):
                return self._end_on_ground(motion)
        elif landed and self._flies:
            self.stands = True
            return self.fail(f"it touched the ground while {self.phase.value}")
        self._flies = self._flies or not landed
        velocity = self._velocity_for(now, motion, height, elapsed)
        if self.phase in (Phase.LAND, Phase.FAILED):
            self._velocity = REST
            return LandingCommand(self.phase, REST, self._reason)
        change = limited((velocity - self._velocity)[:2], self.plan.acceleration * elapsed)
        is_low = height < STANDS_BELOW and self.phase is not Phase.LAST_METRE  # there it follows a swell
        down = min(velocity[2], SOFTLY) if is_low else velocity[2]
        self._velocity = vector(self._velocity[0] + change[0], self._velocity[1] + change[1], down)
        return LandingCommand(self.phase, self._velocity)

    def begin(self, now: float) -> None:
        """Start its clock."""
        self.began = now

    def _start_from(self, now: float, motion: Motion, height: float) -> None:
        self._last_step = now
        self.attempt = 1
        self._velocity = motion.velocity.copy()
        self._home = motion.travelled.copy()
        self._roof = float(motion.travelled[2]) - max(self.plan.leash, self.plan.ceiling)
        self._stay(now, Phase.LOOK, motion.travelled, min(height, self.plan.ceiling))
        self._corners = expanding_square(self.plan.step, self.plan.leash)

    def _stay(self, now: float, phase: Phase, anchor: Vector, height: float) -> None:
        self.phase, self._since = phase, now
        self._anchor, self._height = anchor.copy(), height
        self._integral[:] = 0.0

    def resume(self, now: float, motion: Motion, height: float) -> None:
        """The tag was lost while the autopilot landed: hold, climb, search again."""
        self._last_step = now
        self._velocity = motion.velocity.copy()
        self._stay(now, Phase.HOLD, motion.travelled, height)

    def fail(self, reason: str) -> LandingCommand:
        """End the landing with that reason."""
        if self.phase is not Phase.FAILED:
            self.phase, self._reason, self._velocity = Phase.FAILED, reason, REST
        return LandingCommand(Phase.FAILED, REST, self._reason)

    def _stands(self, now: float, motion: Motion, height: float) -> bool:
        """Whether it does not sink though it is told to, low above the ground."""
        if height > STANDS_BELOW or self._velocity[2] < SLOWEST or motion.velocity[2] > STANDS_SINKING:
            self._sinking_at = now
        return now - self._sinking_at > STANDS

    def _end_on_ground(self, motion: Motion) -> LandingCommand:
        """It stands: the autopilot's LAND disarms it; with a reason if it may not stand on the tag."""
        place, last = self.target.place_at(motion.at), self.target.last
        relative = REST if place is None else place - motion.travelled
        away = self._off_pad(motion, relative) if self.target.moves else 0.0
        if self.phase is Phase.DESCEND or away > OFF_PAD:
            off = f"{away:.1f} m away" if self.target.moves else f"{relative[2]:.1f} m below"
            self._reason = self._reason or f"it touched the ground, though by the picture the tag was {off}"
        elif self.target.moves and last is not None and last.depth > SEEN * self.plan.final:
            self._reason = self._reason or unseen(last.depth)
        self.phase, self._velocity, self._down_by = Phase.LAND, REST, motion.at
        return LandingCommand(Phase.LAND, REST, self._reason)

    def _off_pad(self, motion: Motion, relative: Vector) -> float:
        """Metres off a pad at which a vehicle may stand, that by the foretold motion is `relative` away.

        The pad carries it along. If it is carried otherwise than was foretold, then either's velocity was wrong by so
        much since the pad was seen last, or it stands beside it.
        """
        slip = np.linalg.norm((motion.velocity - self.target.velocity_at(motion.at))[:2])
        off = np.linalg.norm((*relative[:2], max(relative[2], 0.0)))
        return float(off + slip * self.target.age(motion.at) / 2)

    def _failure(self, now: float, motion: Motion) -> str | None:
        assert self.began is not None
        if self.phase is Phase.FAILED:
            return self._reason
        contradiction = self.target.contradiction
        if self.phase is Phase.LAST_METRE:  # too low to climb away, so it goes straight down, and says why
            self._reason = self._reason or contradiction or ""
            return None
        away = float(np.linalg.norm((motion.travelled - self._home)[:2]))
        if not self.target.is_tried and away > LED * self.plan.leash:
            contradiction = contradiction or f"the tag has led the vehicle {away:.0f} m away, and is not believed yet"
        self.refused = contradiction is not None
        return contradiction or self.overdue(now)

    def overdue(self, now: float) -> str | None:
        """Why it must end because its time is over; None while it is not."""
        if self.began is None or now - self.began <= self.plan.time_limit:
            return None
        return f"not landed within {self.plan.time_limit:.0f} s"

    # -- the phases ----------------------------------------------------------------------------------------

    def _velocity_for(self, now: float, motion: Motion, height: float, elapsed: float) -> Vector:
        target = self.target
        visible = target.is_confirmed and target.age(now) <= COAST
        if visible and self.phase in (Phase.LOOK, Phase.HOLD, Phase.CLIMB, Phase.SEARCH):
            return self._tag_in_sight(now, motion, height, elapsed)
        if self.phase is Phase.DESCEND:
            return self._descend(now, motion, height, elapsed)
        if self.phase is Phase.LAST_METRE:
            return self._touch_down(now, motion, height)
        stepping = {Phase.HOLD: self._hold, Phase.CLIMB: self._climb, Phase.SEARCH: self._search}.get(self.phase)
        if stepping is not None:
            return stepping(now, motion, height)
        if self.phase is Phase.LOOK and now - self._since > self.plan.look:
            self._look_farther(now)
        return self._towards(self._anchor, motion, height)

    def _tag_in_sight(self, now: float, motion: Motion, height: float, elapsed: float) -> Vector:
        """The tag is in sight."""
        if not self.plan.descend:
            self.phase = Phase.LAND
            return REST
        lost = self.phase is Phase.CLIMB  # lost on the way down, and seen again from higher up
        if lost and not self._next_attempt("the tag was lost again on the way down"):
            return REST
        place = self.target.place_at(now)
        assert place is not None
        is_held = self.phase is Phase.HOLD and self._descended_by < math.inf
        self.phase, self._since, self._sinking_at = Phase.DESCEND, now, now
        self._bottom = float(place[2]) + BENEATH + (SWELL if self.target.moves else 0.0)
        if not is_held:  # else a tag that blinks would put off its end
            self._descended_by = now + CENTRING + max(float(place[2] - motion.travelled[2]), 0.0) / SLOWEST
        return self._descend(now, motion, height, elapsed)

    def _descend(self, now: float, motion: Motion, height: float, elapsed: float) -> Vector:
        place = self.target.place_at(now)
        assert place is not None
        above = float(place[2] - motion.travelled[2])
        sways = above > CENTRES * self.plan.final or not self.target.is_tried
        beside, swaying = self.target.sway_at(now, above if sways else 0.0)
        offset = (place + beside - motion.travelled)[:2]
        distance = float(np.linalg.norm(offset))
        settled = not self.target.moves or (
            self.target.is_tried and now - self._since > SETTLES and distance < NEARLY
        )
        if self.target.age(now) > COAST:
            if above < BLIND_BELOW and settled:
                return self._go_down(now, motion, height)
            self._stay(now, Phase.HOLD, motion.travelled, height)
            return self._hold(now, motion, height)
        self.offset = distance
        if now > self._descended_by or float(place[2] if self.target.moves else motion.travelled[2]) > self._bottom:
            self.refused = True
            if now > self._descended_by:
                sunk = "the descent took too long"
            elif self.target.moves:
                sunk = "the tag sinks as the vehicle does"
            else:
                sunk = "the descent has sunk as far as the tag was below"
            self.fail(f"{sunk}, and it is still {above:.1f} m below by the picture")
            return REST
        if above <= self.plan.final and distance <= self.plan.tolerance and settled:
            return self._go_down(now, motion, height)
        if distance < 1.0:
            self._integral = limited(self._integral + INTEGRAL * offset * elapsed, INTEGRAL_LIMIT)
        sideways = limited(GAIN * offset + self._integral, self.plan.speed)
        descent = self._descent(distance, above, min(above, height)) if self.target.is_tried else 0.0
        return vector(sideways[0], sideways[1], descent) + swaying + self._pad(now)

    def _go_down(self, now: float, motion: Motion, height: float) -> Vector:
        place = self.target.place_at(now)
        assert place is not None
        above = float(place[2] - motion.travelled[2])
        self.phase, self._since = Phase.LAST_METRE, now
        self._down_by = now + max(above - TOUCH, 0.0) / LAST_DESCENT + LATE
        self._sinking_at = self._falling_at = now
        self.target.is_final = True
        return self._touch_down(now, motion, height)

    def _touch_down(self, now: float, motion: Motion, height: float) -> Vector:
        place = self.target.place_at(now)
        assert place is not None
        relative = place - motion.travelled
        if relative[2] > max(BLIND_BELOW, self.plan.clip) and self.target.age(now) > COAST:
            self.target.is_final = False
            self._stay(now, Phase.HOLD, motion.travelled, height)
            return REST
        if not self.target.is_tried:
            self._reason = self._reason or "on the last metre the tag was not where its motion had it"
        if self.target.moves and not self._touches(now, motion, relative):
            if relative[2] < -MISSED:
                self.target.is_final = False
                return self._climb_to_sight(now, motion, height)
        elif self.target.moves:
            return self._end_on_ground(motion).velocity
        elif relative[2] <= TOUCH or now >= self._down_by:
            self.phase = Phase.LAND
            return REST
        return self._down_onto(now, relative)

    def _down_onto(self, now: float, relative: Vector) -> Vector:
        """The velocity of the last metre, to a place that is `relative` m away; straight down if it is doubted."""
        stands = bool(self._reason) or now >= self._down_by
        sideways = limited(LAST_GAIN * relative[:2] + self._integral, 0.0 if stands else LAST_SPEED)
        return vector(sideways[0], sideways[1], LAST_DESCENT) + self._pad(now)

    def _touches(self, now: float, motion: Motion, relative: Vector) -> bool:
        """Whether it stands on a pad that moves: near it, it sinks no more. LAND would stop it above the pad."""
        if relative[2] > NEAR_PAD or motion.velocity[2] > self.target.velocity_at(now)[2] + LAST_DESCENT / 2:
            self._falling_at = now
        return now - self._falling_at > TOUCHES

    def until_it_lands(self, now: float, motion: Motion | None) -> Vector:
        """The velocity until the autopilot's LAND has taken over: on as on the last metre, because the GPS drifts."""
        place = self.target.place_at(now)
        return REST if place is None or motion is None else self._down_onto(now, place - motion.travelled)

    def _pad(self, now: float) -> Vector:
        """The target's velocity when the vehicle will have followed this setpoint."""
        north, east, down = self.target.velocity_at(now + LAG)
        return vector(north, east, min(max(down, -HEAVES), HEAVES))

    def _descent(self, distance: float, above: float, lowest: float) -> float:
        """m/s down, `distance` m beside the tag and `above` m above it; slow near the ground by any estimate."""
        if above <= self.plan.final:
            return 0.0 if above > 0.7 * self.plan.final else -0.2  # centre first
        room = 1.0 - distance / max(above * math.tan(cone(above)), self.plan.tolerance)
        rate = min(self.plan.descent, SLOWDOWN[0] + SLOWDOWN[1] * (lowest - self.plan.final))
        return max(rate * room, 0.0) if room < SLOWEST else max(rate * room, SLOWEST)

    def _hold(self, now: float, motion: Motion, height: float) -> Vector:
        if self.target.age(now) > HOLD:
            return self._climb_to_sight(now, motion, height)
        return self._along(now, motion, height)

    def _climb_to_sight(self, now: float, motion: Motion, height: float) -> Vector:
        """Climb to where the tag was seen, and farther; from a pad that moves over the highest swell."""
        last, place = self.target.last, self.target.place_at(now)
        assert last is not None and place is not None
        top = max(last.height, height) + CLIMB + (SWELL if self.target.moves else 0.0)
        self._stay(now, Phase.CLIMB, place, min(top, max(self.plan.ceiling, height)))
        return self._along(now, motion, height)

    def _climb(self, now: float, motion: Motion, height: float) -> Vector:
        near = float(np.linalg.norm((self._anchor - motion.travelled)[:2])) < NEAR
        if (near and abs(self._height - height) < NEAR) or now - self._since > 20.0:
            self._corners = expanding_square(self.plan.step, self.plan.leash)
            self._stay(now, Phase.LOOK, self._anchor, self._height)
            self._next_attempt()
        return self._along(now, motion, height)

    def _along(self, now: float, motion: Motion, height: float) -> Vector:
        """The velocity to the anchor, or above a target that moves, as long as its motion is foretold."""
        place = self.target.place_at(now)
        if not self.target.moves or place is None or self.target.age(now) > FOLLOWS:
            return self._towards(self._anchor, motion, height)
        self._anchor = place.copy()
        return self._towards(place, motion, height) + self._pad(now) * (1.0, 1.0, 0.0)

    def _next_attempt(self, reason: str = "no tag in sight") -> bool:
        """Begin another attempt; False if none is left, and the landing has failed."""
        if self.attempt >= self.plan.attempts:
            times = f"{self.attempt} attempt{'' if self.attempt == 1 else 's'}"
            self.fail(f"{reason} after {times}")
            return False
        self.attempt += 1
        return True

    def _look_farther(self, now: float) -> None:
        """Nothing in sight from here: fly the next leg of the search."""
        corner = next(self._corners, None)
        if corner is None:
            self.fail(f"no tag in sight within {self.plan.leash:g} m")
            return
        if self._corner is None or corner.ring != self._corner.ring or self.phase is Phase.LOOK:
            self._next_attempt()
        if self.phase is not Phase.FAILED:
            self.phase, self._since, self._corner = Phase.SEARCH, now, corner

    def _search(self, now: float, motion: Motion, height: float) -> Vector:
        assert self._corner is not None
        corner_place = self._anchor + vector(self._corner.north, self._corner.east, 0.0)
        if np.linalg.norm((corner_place - motion.travelled)[:2]) < NEAR or now - self._since > 60.0:
            self._look_farther(now)
        return self._towards(corner_place, motion, height)

    def _towards(self, place: Vector, motion: Motion, height: float) -> Vector:
        """The velocity to the point above `place`, at the held height."""
        sideways = limited(GAIN * (place - motion.travelled)[:2], self.plan.speed)
        up = VERTICAL_GAIN * (self._height - height) if motion.travelled[2] > self._roof else 0.0
        return vector(sideways[0], sideways[1], -min(max(up, -self.plan.descent), self.plan.climb))


def unseen(depth: float) -> str:
    """That a tag was last seen so many m below."""
    return f"the tag was not seen below {depth:.1f} m: the vehicle may stand beside it"


def cone(height: float) -> float:
    """Half angle (rad) around the vertical within which it may descend, `height` m above the target."""
    (high, wide), (low, narrow) = CONE
    share = min(max((height - low) / (high - low), 0.0), 1.0)
    return narrow + share * (wide - narrow)
