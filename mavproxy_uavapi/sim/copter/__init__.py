"""The copter: ArduCopter with four rotors."""
