"""Estimates the motion of a target that moves, such as a tag on a vehicle or a ship. Pure."""

from __future__ import annotations

import math

import numpy as np

from mavproxy_vision.geometry.frames import Matrix, Vector
from mavproxy_vision.tracking.target_filter import Target, TargetMeasurement

MANOEUVRE = (0.8, 0.8, 0.5)  # m/s/s, standard deviation of its acceleration: turns of a vehicle, the swell of the sea
LASTS = 2.0  # s for which it accelerates alike
FASTEST = 1.5  # m/s, standard deviation of its velocity before it is known
AHEAD = 2.5  # s for which its motion is foretold …
STEADY = 1.0  # … with its acceleration for so many of them


class MovingTarget(Target):
    """The estimate: a Kalman filter with position, velocity and acceleration on each axis.

    Singer, "Estimating Optimal Tracking Filter Performance for Manned Maneuvering Targets" (IEEE Trans. AES-6, 1970):
    the acceleration fades, and is driven by white noise.
    """

    moves = True

    def __init__(self) -> None:
        super().__init__()
        self._state: Matrix = np.zeros((3, 3))  # position, velocity, acceleration by axis: m, m/s, m/s/s NED
        self._covariance = np.zeros((3, 3, 3))  # of these, by axis

    def place_at(self, now: float) -> Vector | None:
        """See `Target.place_at`."""
        if self.place is None:
            return None
        seconds = min(max(now - self.seen_at, 0.0), AHEAD)
        steady = min(seconds, STEADY)
        place, velocity, acceleration = self._state
        foretold: Vector = place + velocity * seconds + acceleration * steady * (seconds - steady / 2)
        return foretold

    def velocity_at(self, now: float) -> Vector:
        """See `Target.velocity_at`."""
        steady = min(max(now - self.seen_at, 0.0), STEADY)
        velocity: Vector = self._state[1] + self._state[2] * steady
        return velocity

    def _predicted(self, at: float) -> tuple[Matrix, Matrix]:
        """State and covariance at a time."""
        t = max(at - self.seen_at, 0.0)
        onward = np.array([[1.0, t, t * t / 2], [0.0, 1.0, t], [0.0, 0.0, math.exp(-t / LASTS)]])
        driven = np.array([[t**5 / 20, t**4 / 8, t**3 / 6], [t**4 / 8, t**3 / 3, t**2 / 2], [t**3 / 6, t**2 / 2, t]])
        noise = np.array([2 * sigma**2 / LASTS * driven for sigma in MANOEUVRE])
        return onward @ self._state, onward @ self._covariance @ onward.T + noise

    def _correct(self, measurement: TargetMeasurement, noise: Vector) -> None:
        state, covariance = self._predicted(measurement.at)
        gain = covariance[:, :, 0] / (covariance[:, :1, 0] + noise[:, None])  # (axis, state)
        self._state = state + (gain * (measurement.place - state[0])[:, None]).T
        self._covariance = covariance - gain[:, :, None] * covariance[:, :1, :]
        self.place = self._state[0].copy()

    def _begin(self, measurement: TargetMeasurement, noise: Vector) -> None:
        self._state = np.stack([measurement.place, np.zeros(3), np.zeros(3)])
        self._covariance = np.array(
            [np.diag([part, FASTEST**2, sigma**2]) for part, sigma in zip(noise, MANOEUVRE, strict=True)]
        )
        super()._begin(measurement, noise)

    def _spread(self, at: float) -> float:
        return math.sqrt(float(self._predicted(at)[1][:, 0, 0].max()))
