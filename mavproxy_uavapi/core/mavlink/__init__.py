"""The link, and what its messages tell of each vehicle."""
