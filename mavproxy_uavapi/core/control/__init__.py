"""Who commands a vehicle: jobs, the authority, the right to send."""
