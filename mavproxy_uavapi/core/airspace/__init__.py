"""Where vehicles may fly: envelopes, braking, the guard before the link, separation."""
