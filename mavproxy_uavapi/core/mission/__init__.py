"""Missions: their items and files, and the way that they lead along."""
