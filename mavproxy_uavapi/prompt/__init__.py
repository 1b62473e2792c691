"""What `uavapi` says and takes at MAVProxy's prompt, and shows in its windows."""
