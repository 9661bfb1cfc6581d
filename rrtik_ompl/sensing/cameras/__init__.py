"""Cameras: the pinhole model, a head that pans and tilts, files of others, tone, pictures, and a synthetic camera."""
