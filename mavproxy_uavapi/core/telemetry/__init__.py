"""What vehicles tell us: their state, their clocks, the waits for their messages."""
