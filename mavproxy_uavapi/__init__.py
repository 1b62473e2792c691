"""MAVProxy module `uavapi`: an HTTP API to arm, fly, watch and script a vehicle."""

__version__ = "0.1.0"  # the one place that says it
