"""From a problem to a path."""
