"""Devices of a session: the arm, the camera, and simulations of both."""
