"""The records of flights: a file each, with all that was seen and commanded, to take home."""
