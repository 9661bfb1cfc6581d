"""Inverse kinematics: every method, goals of the tip, reach."""
