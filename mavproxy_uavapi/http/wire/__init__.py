"""Connections, and the bodies that come over them."""
