"""Checks for actions that need more than a valid caller."""

from __future__ import annotations

from aiohttp import web

from mavproxy_uavapi.core.errors import Forbidden
from mavproxy_uavapi.core.roles import Role
from mavproxy_uavapi.files import rehearsals
from mavproxy_uavapi.http.callers.call import SERVICE, Call
from mavproxy_uavapi.http.callers.caller import CALLER, Caller
from mavproxy_uavapi.http.contract.route import Route
from mavproxy_uavapi.scripts import clients


def may_use(request: web.BaseRequest, route: Route) -> bool:
    """Whether the caller's role is enough for a route; a file of the page is for everybody."""
    caller = request.get(CALLER)
    return caller is None or caller.role >= route.needs


def require_role(request: web.BaseRequest, route: Route, *, read_only: bool) -> None:
    """Raise Forbidden unless the caller's role is enough for the route; if the API is read only, watching is all."""
    if read_only and route.needs > Role.WATCH:
        raise Forbidden(f"{route.path} commands, and this API is read only (the setting `read_only`)")
    if not may_use(request, route):
        name, role = request[CALLER].name, request[CALLER].role
        raise Forbidden(f"{route.path} needs a token for `{route.needs.word}`; that of {name} is for `{role.word}`")


def require_own_vehicle(request: web.BaseRequest, route: Route) -> None:
    """Raise Forbidden if a script that is rehearsed would command us: it has our address written in it.

    It awaits nothing, 2 ms while there is a rehearsal: a client that hangs up meanwhile would end its own `stop`.
    """
    caller, transport = request.get(CALLER), request.transport
    if caller is None or not caller.is_local or transport is None or route.needs <= Role.WATCH:
        return
    if request[SERVICE].is_rehearsal or not rehearsals.is_under_way():
        return
    port, own_port = (transport.get_extra_info(end)[1] for end in ("peername", "sockname"))
    if clients.is_rehearsed(port, own_port):
        raise Forbidden("a rehearsal commands no vehicle of ours: its script takes UAVAPI_URL from its environment")


def is_owner(call: Call) -> bool:
    """Whether the caller is an admin with the token, of this machine, or of a network that may do more."""
    caller: Caller = call.request[CALLER]
    trusted = caller.has_token or caller.is_local or caller.is_in(call.service.settings.allow_scripts_from)
    return caller.role >= Role.ADMIN and trusted


def require_owner(call: Call, what: str) -> None:
    """Raise Forbidden unless the caller has the token, is of this machine, or of a network that may do more.

    Args:
        call: the call.
        what: begins the sentence "…: call with the token …".
    """
    if not is_owner(call):
        raise Forbidden(f"{what}: call with the token, or from this machine, or set allow_scripts_from")
