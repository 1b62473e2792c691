"""Rotations, the camera's mount, the camera model."""
