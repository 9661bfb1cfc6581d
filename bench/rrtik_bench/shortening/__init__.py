"""Shortening among planar obstacles [1, ch. 5.3]: what was published, and the runs that are compared with it."""
