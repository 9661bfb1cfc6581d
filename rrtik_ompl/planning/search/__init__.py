"""Search in configuration space in Python, for any motion check: RRT-Connect and the tree that it grows."""
