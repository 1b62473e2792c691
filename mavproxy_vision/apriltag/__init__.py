"""AprilTags: the tags to look for, their detection in a frame, and their drawing."""
