"""Inverse kinematics: algorithms on arrays, each in its own module, that take validity as a callable."""
