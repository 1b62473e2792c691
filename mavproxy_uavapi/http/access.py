"""What not every caller may do who passed the door."""

from __future__ import annotations

from mavproxy_uavapi.core.errors import Forbidden
from mavproxy_uavapi.http.call import Call
from mavproxy_uavapi.http.caller import CALLER, Caller


def require_owner(call: Call, what: str) -> None:
    """Raise Forbidden unless the caller has the token, is of this machine, or of a network that may do more.

    Args:
        call: the call.
        what: begins the sentence "…: call with the token …".
    """
    caller: Caller = call.request[CALLER]
    if not (caller.has_token or caller.is_local or caller.is_in(call.service.settings.allow_scripts_from)):
        raise Forbidden(f"{what}: call with the token, or from this machine, or set allow_scripts_from")
