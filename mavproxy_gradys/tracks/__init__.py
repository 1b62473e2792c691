"""Tracks: recorded, read, and flown."""
