"""Addresses, names, HTTP, and the schedule of tries."""
