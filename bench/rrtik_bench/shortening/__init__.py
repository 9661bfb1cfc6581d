"""Shortening of paths among planar obstacles: what was published, and the runs that are compared with it."""
