"""A small receiver to try the module with: `python -m mavproxy_gradys.station`."""
