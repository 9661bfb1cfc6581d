"""Straight lines of the tip and tasks, measured."""
