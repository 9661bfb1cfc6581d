"""Cameras: the pinhole model, a head that pans and tilts, and where pictures come from."""
