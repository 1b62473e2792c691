"""What we tell vehicles, and their answers: messages, acknowledgements, parameters, transfers."""
