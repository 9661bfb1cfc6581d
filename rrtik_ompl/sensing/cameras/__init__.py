"""Cameras: the pinhole model, its file, calibration, pictures, and a synthetic camera."""
