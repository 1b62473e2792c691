"""MAVProxy module `gradys`: pushes position and readings to the GrADyS ground station."""
