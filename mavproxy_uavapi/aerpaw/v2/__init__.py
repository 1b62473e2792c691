"""aerpawlib's `v2`: what differs from `v1`."""
