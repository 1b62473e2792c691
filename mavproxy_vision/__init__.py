"""MAVProxy module `vision`: camera, AprilTags, search and precise landing on a tag."""
