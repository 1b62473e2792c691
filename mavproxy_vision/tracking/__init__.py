"""From frames and telemetry to where the target lies."""
