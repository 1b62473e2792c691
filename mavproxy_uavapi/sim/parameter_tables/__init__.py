"""The parameters of each type: only data."""
