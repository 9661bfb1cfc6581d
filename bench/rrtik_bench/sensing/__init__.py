"""Marker sensing [1, ch. 4]: what was published, and the runs that are compared with it."""
