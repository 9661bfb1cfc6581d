"""Searches for paths below a length, in the space of configurations and costs."""
