"""The push of positions to ground stations."""
