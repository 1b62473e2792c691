"""Shows the vehicles of an MQTT broker on GrADyS ground stations, which take positions by HTTP only."""
