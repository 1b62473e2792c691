"""The plane and the QuadPlane: ArduPilot's ArduPlane."""
