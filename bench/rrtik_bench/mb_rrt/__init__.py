"""MB-RRT [3]: what was published, and the runs that are compared with it."""
