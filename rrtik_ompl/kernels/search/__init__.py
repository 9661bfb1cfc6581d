"""Searches in kernels: RRT-Connect, search trees, random shortcuts, repair of a path."""
