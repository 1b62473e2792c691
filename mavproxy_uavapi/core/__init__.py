"""What the three modules stand on: MAVProxy's main loop, the link, the vehicles. It imports none of them."""
