"""Where frames come from: cameras, streams, files, posts, and a simulated one."""
