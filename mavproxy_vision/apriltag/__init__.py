"""AprilTags: which are looked for, how they are found in a frame, and how they are drawn."""
