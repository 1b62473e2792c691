"""A request: who makes it, and what it means."""
