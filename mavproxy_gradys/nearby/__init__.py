"""Vehicles of other MAVProxys that come near, by the positions that they tell an MQTT broker."""
