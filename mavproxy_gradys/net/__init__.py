"""Addresses, names, HTTP, and how often to try."""
