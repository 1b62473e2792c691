"""`mavproxy-uavapi setup` and `mavproxy-uavapi token`: a companion computer that flies from the next boot on.

`plan` says what is written (pure), `autopilot` finds the serial port and hears the vehicle, `setup` asks and does it,
`token` gives operators their tokens, with a link and a QR code for a phone.
"""
