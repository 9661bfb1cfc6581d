"""Spaces of OMPL in which our planners work: what numbers a state has, and angles laid out on a line."""
