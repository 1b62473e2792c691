"""What tests of several packages use: clocks, vehicles, links, MAVProxy's state."""
