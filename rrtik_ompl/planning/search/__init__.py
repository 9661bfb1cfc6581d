"""Roadmaps, and searches in configuration space in Python for any motion check."""
