"""The rover: ArduPilot's Rover with one steered axle."""
