"""The application and its ports."""
