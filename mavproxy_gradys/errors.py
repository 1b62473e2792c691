"""The errors of this module, branches of the one tree in `mavproxy_uavapi.core.errors`.

Unavailable                503
|- NoFix                   503 no_fix        the vehicle does not know its position
|- NotStored               503 not_stored    the spool cannot take readings just now
|- NoReading               503 no_reading    a sensor gives no value just now
`- NotDelivered            503 not_delivered a station, receiver or broker did not take what was sent
"""

from __future__ import annotations

from mavproxy_uavapi.core.errors import Unavailable


class NoFix(Unavailable):
    """The vehicle has no position fix, so there is nothing to send."""

    code = "no_fix"


class NoReading(Unavailable):
    """A sensor gives no value just now.

    Attributes:
        cause: the same for all errors that have one reason; the text may differ.
    """

    code = "no_reading"

    def __init__(self, cause: str, sentence: str) -> None:
        super().__init__(sentence)
        self.cause = cause


class NotStored(Unavailable):
    """The spool cannot take readings: the disk is full, or the file is not ours."""

    code = "not_stored"


class NotDelivered(Unavailable):
    """The data sent was not accepted.

    Attributes:
        reached: whether the receiver answered; if not, there is no need to try the next one.
        too_large: whether it was refused because of its size.
        for_content: whether other or less data may be accepted.
    """

    code = "not_delivered"

    def __init__(
        self, sentence: str, reached: bool = False, too_large: bool = False, for_content: bool = False
    ) -> None:
        super().__init__(sentence)
        self.reached = reached
        self.too_large = too_large
        self.for_content = for_content or too_large
