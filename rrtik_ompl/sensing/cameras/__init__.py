"""Cameras: the pinhole model, a pan-tilt-zoom head, and sources of pictures."""
