"""Other programs that are run, and the cameras among them."""
