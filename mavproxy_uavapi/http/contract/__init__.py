"""What is asked and what is answered: models, types, routes."""
