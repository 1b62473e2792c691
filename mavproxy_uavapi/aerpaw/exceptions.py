"""`aerpawlib.v1.exceptions` and `v2.exceptions`: the errors that scripts catch; `original_error` is the API's."""

from __future__ import annotations

import re
from collections.abc import Iterable


class AerpawlibError(Exception):
    """The base of all errors.

    Attributes:
        message: the text.
        original_error: its cause; None without one.
        code: the class as a word, such as NOT_ARMABLE.
        severity: warning, error or critical.
    """

    code = "UNKNOWN"
    severity = "error"
    default_message = ""

    def __init_subclass__(cls) -> None:
        if "code" not in cls.__dict__:
            words = re.findall(r"[A-Z]+(?=[A-Z][a-z])|[A-Z][a-z]+", cls.__name__)
            cls.code = "_".join(words[:-1] if len(words) > 2 else words).upper()

    def __init__(
        self,
        message: str | None = None,
        original_error: Exception | None = None,
        *,
        code: str | None = None,
        severity: str | None = None,
    ) -> None:
        self.message = self.default_message if message is None else message
        self.original_error = original_error
        self.code, self.severity = code or self.code, severity or self.severity
        super().__init__(self.message)

    def __str__(self) -> str:
        cause = str(self.original_error or "")
        return self.message if cause in self.message else f"{self.message} (caused by: {cause})"


class AerpawConnectionError(AerpawlibError):
    """No connection to the vehicle."""

    code = "CONNECTION_ERROR"


class ConnectionTimeoutError(AerpawConnectionError):
    """No connection within the timeout."""

    def __init__(self, timeout_seconds: float, message: str | None = None) -> None:
        self.timeout_seconds = timeout_seconds
        super().__init__(message or f"Connection timed out after {timeout_seconds} seconds")


class HeartbeatLostError(AerpawConnectionError):
    """The vehicle's heartbeats have stopped."""

    severity = "critical"

    def __init__(self, last_heartbeat_age: float = 0.0, message: str | None = None) -> None:
        self.last_heartbeat_age = last_heartbeat_age
        super().__init__(message or f"Vehicle heartbeat lost (last heartbeat {last_heartbeat_age:.1f}s ago)")


class PortInUseError(AerpawConnectionError):
    """A port is in use."""

    def __init__(self, port: int, message: str | None = None) -> None:
        self.port = port
        super().__init__(message or f"Port {port} is already in use")


class MAVSDKNotInstalledError(AerpawConnectionError):
    """MAVSDK is missing; never raised here, because nothing needs it."""

    default_message = "MAVSDK is not installed"


class AERPAWPlatformError(AerpawlibError):
    """A request to the AERPAW platform failed."""


class NotInAERPAWEnvironmentError(AERPAWPlatformError):
    """There is no AERPAW platform."""

    def __init__(self, feature: str) -> None:
        self.feature = feature
        super().__init__(f"{feature} is only available in the AERPAW environment")


class CommandError(AerpawlibError):
    """A command failed."""

    what = "Command failed"

    def __init__(self, reason: str = "Unknown", original_error: Exception | None = None) -> None:
        super().__init__(f"{self.what}: {reason}", original_error)


class ArmError(CommandError):
    """Arming failed."""

    what = "Failed to arm vehicle"


class DisarmError(CommandError):
    """Disarming failed."""

    what = "Failed to disarm vehicle"


class TakeoffError(CommandError):
    """The takeoff failed."""

    what = "Takeoff failed"


class LandingError(CommandError):
    """The landing failed."""

    what = "Landing failed"


class NavigationError(CommandError):
    """The vehicle did not arrive."""

    what = "Navigation failed"


class VelocityError(CommandError):
    """A velocity was refused."""

    what = "Set velocity failed"


class HeadingError(CommandError):
    """The vehicle did not turn."""

    what = "Set heading failed"


class RTLError(CommandError):
    """The return to launch failed."""

    what = "RTL (return to launch) failed"


class TaskCancelledError(CommandError):
    """A task was cancelled."""

    what = "Task was cancelled"


class StateError(AerpawlibError):
    """The vehicle's state does not allow the command."""


class NotArmableError(StateError):
    """The vehicle cannot be armed now."""

    def __init__(self, reason: str = "Vehicle not in armable state") -> None:
        super().__init__(f"Cannot arm: {reason}")


class NotConnectedError(StateError):
    """The vehicle's telemetry is missing or too old."""

    default_message = "Vehicle is not connected"


class AbortedError(StateError):
    """The operation was aborted."""

    default_message = "Operation was aborted"


class UnexpectedDisarmError(StateError):
    """The vehicle has disarmed, and its script has not landed or disarmed it."""

    severity = "critical"
    default_message = "Vehicle disarmed unexpectedly during experiment"


class ValidationError(AerpawlibError):
    """A value is invalid."""


class OutOfRangeError(ValidationError):
    """The base of the errors for a value that is out of range."""

    what, unit = "Value", ""

    def __init__(self, value: float, min_val: float, max_val: float, param_name: str | None = None) -> None:
        self.value, self.min_val, self.max_val = value, min_val, max_val
        bound = f"at least {min_val}" if value < min_val else f"at most {max_val}"
        super().__init__(f"{param_name or self.what} must be {bound} {self.unit}, got {value}")


class InvalidToleranceError(OutOfRangeError, ValueError):
    """A tolerance (m) is out of range."""

    what, unit = "tolerance", "m"


class InvalidAltitudeError(OutOfRangeError):
    """An altitude (m) is out of range."""

    what, unit = "Altitude", "m"


class InvalidSpeedError(OutOfRangeError):
    """A speed (m/s) is out of range."""

    what, unit = "Speed", "m/s"


class PlanError(ValidationError, ValueError):
    """A .plan file cannot be read."""


class NotImplementedForVehicleError(AerpawlibError, NotImplementedError):
    """This type of vehicle does not have the feature."""

    def __init__(self, feature: str, vehicle_type: str) -> None:
        self.feature, self.vehicle_type = feature, vehicle_type
        super().__init__(f"'{feature}' is not implemented for {vehicle_type} vehicles")


class RunnerError(AerpawlibError):
    """A runner is invalid."""


StateMachineError = RunnerError  # v1's name


class NoEntrypointError(RunnerError):
    """A BasicRunner has no entrypoint."""

    default_message = "No @entrypoint declared"


class InvalidStateError(RunnerError):
    """There is no such state."""

    def __init__(self, state_name: str, available_states: Iterable[str]) -> None:
        self.state_name, self.available_states = state_name, list(available_states)
        super().__init__(f"There is no state '{state_name}'; there are {', '.join(sorted(self.available_states))}")


class NoInitialStateError(RunnerError):
    """No state is marked as the first."""

    default_message = "There is no initial state"


class MultipleInitialStatesError(RunnerError):
    """Several states are marked as the first."""

    default_message = "Multiple initial states: There may only be one initial state"


class InvalidStateNameError(RunnerError):
    """A state has no name."""

    default_message = "State name cannot be empty string"
