"""The envelope: where vehicles may fly, how high and how fast. Geometry, file formats and braking; all pure."""
