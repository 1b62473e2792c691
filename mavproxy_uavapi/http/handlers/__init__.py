"""The actions of the routes."""
