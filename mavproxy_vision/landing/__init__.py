"""Search, landing and mission, and their reports."""
