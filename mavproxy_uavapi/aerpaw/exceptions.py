"""`aerpawlib.v1.exceptions`: what scripts catch. `original_error` is the API's own, where there was one."""

from __future__ import annotations

from collections.abc import Iterable


class AerpawlibError(Exception):
    """Base of them all.

    Attributes:
        message: a sentence.
        original_error: what it came from.
    """

    def __init__(self, message: str, original_error: Exception | None = None) -> None:
        self.message, self.original_error = message, original_error
        super().__init__(message)


class AerpawConnectionError(AerpawlibError):
    """No connection to the vehicle."""


class ConnectionTimeoutError(AerpawConnectionError):
    """Not connected within so many s."""

    def __init__(self, timeout_seconds: float, message: str | None = None) -> None:
        self.timeout_seconds = timeout_seconds
        super().__init__(message or f"Connection timed out after {timeout_seconds} seconds")


class HeartbeatLostError(AerpawConnectionError):
    """The vehicle is not heard any more."""

    def __init__(self, last_heartbeat_age: float = 0.0, message: str | None = None) -> None:
        self.last_heartbeat_age = last_heartbeat_age
        super().__init__(message or f"Vehicle heartbeat lost (last heartbeat {last_heartbeat_age:.1f}s ago)")


class PortInUseError(AerpawConnectionError):
    """A port is taken."""

    def __init__(self, port: int, message: str | None = None) -> None:
        self.port = port
        super().__init__(message or f"Port {port} is already in use")


class AERPAWPlatformError(AerpawlibError):
    """The AERPAW platform does not do what was asked."""


class NotInAERPAWEnvironmentError(AERPAWPlatformError):
    """There is no platform."""

    def __init__(self, feature: str) -> None:
        super().__init__(f"{feature} is only available in the AERPAW environment")


class CommandError(AerpawlibError):
    """A command failed."""

    what = "Command failed"

    def __init__(self, reason: str = "Unknown", original_error: Exception | None = None) -> None:
        super().__init__(f"{self.what}: {reason}", original_error)


class ArmError(CommandError):
    """It was not armed."""

    what = "Failed to arm vehicle"


class DisarmError(CommandError):
    """It was not disarmed."""

    what = "Failed to disarm vehicle"


class TakeoffError(CommandError):
    """It did not take off."""

    what = "Takeoff failed"


class LandingError(CommandError):
    """It did not land."""

    what = "Landing failed"


class NavigationError(CommandError):
    """It did not arrive."""

    what = "Navigation failed"


class VelocityError(CommandError):
    """It does not fly at a velocity."""

    what = "Set velocity failed"


class HeadingError(CommandError):
    """It did not turn."""

    what = "Set heading failed"


class RTLError(CommandError):
    """It did not return."""

    what = "Return to launch failed"


class StateError(AerpawlibError):
    """The vehicle's state stands against it."""


class NotArmableError(StateError):
    """It cannot be armed just now."""

    def __init__(self, reason: str = "Vehicle not in armable state") -> None:
        super().__init__(f"Cannot arm: {reason}")


class NotConnectedError(StateError):
    """The vehicle does not tell, or has not told of late."""

    def __init__(self, message: str = "Vehicle is not connected") -> None:
        super().__init__(message)


class AbortedError(StateError):
    """It was ended."""

    def __init__(self, message: str = "Operation was aborted") -> None:
        super().__init__(message)


class ValidationError(AerpawlibError):
    """A value makes no sense."""


class InvalidToleranceError(ValidationError, ValueError):
    """A tolerance (m) that no flight can keep, or that is none."""

    def __init__(self, value: float, min_val: float, max_val: float, param_name: str = "tolerance") -> None:
        self.value, self.min_val, self.max_val = value, min_val, max_val
        bound = f"at least {min_val}" if value < min_val else f"at most {max_val}"
        super().__init__(f"{param_name} must be {bound} m, got {value}")


class InvalidAltitudeError(ValidationError):
    """An altitude (m) out of bounds."""

    def __init__(self, value: float, min_val: float, max_val: float) -> None:
        super().__init__(f"Altitude must be between {min_val} m and {max_val} m, got {value}")


class InvalidSpeedError(ValidationError):
    """A speed (m/s) out of bounds."""

    def __init__(self, value: float, min_val: float, max_val: float) -> None:
        super().__init__(f"Speed must be between {min_val} m/s and {max_val} m/s, got {value}")


class NotImplementedForVehicleError(AerpawlibError):
    """This type of vehicle does not do that."""

    def __init__(self, feature: str, vehicle_type: str) -> None:
        super().__init__(f"'{feature}' is not implemented for {vehicle_type} vehicles")


class StateMachineError(AerpawlibError):
    """A runner that makes no sense."""


class NoEntrypointError(StateMachineError):
    """A BasicRunner without a beginning."""

    def __init__(self) -> None:
        super().__init__("No @entrypoint declared")


class InvalidStateError(StateMachineError):
    """A state that there is not."""

    def __init__(self, state_name: str, available_states: Iterable[str]) -> None:
        self.state_name = state_name
        super().__init__(f"There is no state '{state_name}'; there are {', '.join(sorted(available_states))}")


class NoInitialStateError(StateMachineError):
    """No state is the first."""

    def __init__(self) -> None:
        super().__init__("There is no initial state")


class MultipleInitialStatesError(StateMachineError):
    """Two states are the first."""

    def __init__(self) -> None:
        super().__init__("There may only be one initial state")


class InvalidStateNameError(StateMachineError):
    """A state without a name."""

    def __init__(self) -> None:
        super().__init__("State name cannot be empty string")
