"""What all three modules share: the bridge into MAVProxy, the state of every vehicle, and who waits for what."""
