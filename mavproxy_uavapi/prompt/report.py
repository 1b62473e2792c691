"""The prompt's texts about the API. Pure."""

from __future__ import annotations

from mavproxy_uavapi.api import Api
from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_uavapi.core.telemetry.flight_modes import kind_of, mode_name
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState
from mavproxy_uavapi.core.text import joined
from mavproxy_uavapi.settings import ApiSettings


def report(api: Api, settings: ApiSettings) -> str:
    """A few lines: the address, the vehicle, the calls in flight."""
    address = settings.url
    lines = [f"uavapi: {'listening on' if api.listening else 'not listening; it would be'} {address}"]
    lines += [f"port {port}: vehicle {system}" for port, system in settings.ports.items()]
    try:
        lines.append(describe(api, api.host.registry.find(settings.sysid).state))
    except UavApiError as error:
        lines.append(str(error))
    running = api.host.jobs.running()
    lines.append(f"{len(running)} call{'' if len(running) == 1 else 's'} in flight")
    lines += [f"  {job.id}: {job.verb} {_progress(job.progress)}".rstrip() for job in running]
    return joined(lines)


def vehicles(api: Api) -> str:
    """A line for each known vehicle."""
    fleet = api.host.fleet.vehicles
    if not fleet:
        return "uavapi: no vehicle was heard yet"
    return joined(describe(api, state) for _, state in sorted(fleet.items()))


def describe(api: Api, state: VehicleState) -> str:
    """One vehicle as a line."""
    armed = {True: "armed", False: "disarmed", None: "armed or not: unknown"}[state.armed]
    link = "link ok" if api.host.link_watch.is_alive(state) else "LINK LOST"
    age = api.host.clock() - state.heartbeat_at
    kind = kind_of(state.vehicle_type)
    mode = mode_name(state.vehicle_type, state.mode)
    loss = 100 * state.packets.share
    return f"vehicle {state.system}: {kind}, {mode}, {armed}, {link} (heartbeat {age:.1f} s ago, {loss:.1f} % lost)"


def _progress(progress: dict[str, float]) -> str:
    return ", ".join(f"{name.replace('_', ' ')} {value:.1f} m" for name, value in progress.items())
