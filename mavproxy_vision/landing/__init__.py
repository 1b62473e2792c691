"""FlightJobs: search, landing, mission, and what they tell of themselves."""
