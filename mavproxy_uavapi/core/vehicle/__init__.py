"""The verbs: what a pilot may ask of a vehicle, and how each one knows that it was done."""
