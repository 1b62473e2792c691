"""The link, and the state of each vehicle by its messages."""
