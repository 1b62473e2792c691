"""The HTTP side: routes, request models, answers."""
