"""The errors of this module, branches of the one tree in `mavproxy_uavapi.core.errors`.

Unavailable                503
|- NoFix                   503 no_fix        the vehicle does not know where it is
|- NotStored               503 not_stored    the spool cannot take readings just now
`- NotDelivered            503 not_delivered a station, receiver or broker did not take what was sent
"""

from __future__ import annotations

from mavproxy_uavapi.core.errors import Unavailable


class NoFix(Unavailable):
    """The vehicle has no position fix: there is nothing to tell."""

    code = "no_fix"


class NotStored(Unavailable):
    """The spool cannot take readings: the disk is full, or the file is not ours."""

    code = "not_stored"


class NotDelivered(Unavailable):
    """What was sent was not taken.

    Attributes:
        reached: whether somebody answered at all; if not, the next one need not be tried either.
        too_large: whether it was refused for its size.
        for_content: whether something else, or less of it, may be taken.
    """

    code = "not_delivered"

    def __init__(
        self, sentence: str, reached: bool = False, too_large: bool = False, for_content: bool = False
    ) -> None:
        super().__init__(sentence)
        self.reached = reached
        self.too_large = too_large
        self.for_content = for_content or too_large
