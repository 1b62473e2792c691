"""One look at a vehicle: what it is doing, whether it can be flown, and why not. Pure."""

from __future__ import annotations

from typing import Any

from pymavlink import mavutil

from mavproxy_uavapi.core.vehicle.vehicle import Vehicle

mavlink = mavutil.mavlink

TEXT_AGE = 60.0  # s; ArduPilot repeats what keeps it from arming every 30 s
ABOUT_ARMING = ("PreArm:", "Arm:")


def condition(vehicle: Vehicle, link_alive: bool, now: float) -> dict[str, Any]:
    """What a pilot wants to know first.

    Args:
        vehicle: whose state.
        link_alive: whether heartbeats come.
        now: on the clock of arrivals (s).
    """
    state = vehicle.state
    reasons = why_not(vehicle, link_alive, now)
    return {
        "mode": vehicle.mode,
        "armed": state.armed,
        "landed_state": landed_state(vehicle),
        "link": {
            "alive": link_alive,
            "heartbeat_age_s": round(now - state.heartbeat_at, 3),
            "packet_loss": round(state.packets.share, 4),
        },
        "ekf_ok": vehicle.has_position,
        "gps_fix": state.field("GPS_RAW_INT", "fix_type"),
        "battery_remaining": _battery(vehicle),
        "ready_to_arm": not reasons,
        "why_not": reasons,
    }


def landed_state(vehicle: Vehicle) -> str:
    """`on_ground` (a rover or boat: always), `in_air`, `takeoff`, `landing`, or `unknown`."""
    number = vehicle.state.recent_field("EXTENDED_SYS_STATE", "landed_state")
    if number:
        name: str = mavlink.enums["MAV_LANDED_STATE"][number].name
        return name.removeprefix("MAV_LANDED_STATE_").lower()
    if vehicle.state.landed is None:
        return "unknown"
    return "on_ground" if vehicle.state.landed else "in_air"


def why_not(vehicle: Vehicle, link_alive: bool, now: float) -> list[str]:
    """What keeps the vehicle from being armed; empty when nothing does, or when it is armed."""
    state = vehicle.state
    if not link_alive:
        return [f"no heartbeat for {now - state.heartbeat_at:.1f} s"]
    if state.are_two(now):
        return [f"two autopilots have the system id {state.system}"]
    if state.armed:
        return []
    reasons = []
    if not vehicle.has_position:
        reasons.append("no position estimate yet")
    if (state.recent_field("GPS_RAW_INT", "fix_type") or 0) < mavlink.GPS_FIX_TYPE_3D_FIX:
        reasons.append("no 3D GPS fix")
    if not vehicle.is_ready_to_arm:
        texts = [text for text in state.statustexts.since(now - TEXT_AGE) if text.startswith(ABOUT_ARMING)]
        reasons.extend(dict.fromkeys(texts) or ["pre-arm checks do not pass"])
    return reasons


def _battery(vehicle: Vehicle) -> int | None:
    remaining: int | None = vehicle.state.recent_field("SYS_STATUS", "battery_remaining")
    return None if remaining == -1 else remaining
