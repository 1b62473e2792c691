"""Readings: sampled, kept in a spool, and sent until each sink has acknowledged them."""
