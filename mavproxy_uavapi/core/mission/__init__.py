"""Missions: what the autopilot of each type makes of each item. Pure."""
