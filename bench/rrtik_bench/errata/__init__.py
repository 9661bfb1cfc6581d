"""Errors of the sources, each shown by a computation."""
