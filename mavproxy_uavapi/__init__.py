"""MAVProxy module `uavapi`: an HTTP API to arm, fly, watch and script a vehicle."""
