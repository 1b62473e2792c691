"""The station: keeps a fleet's readings, and shows it: `python -m mavproxy_gradys.station`."""
