"""Levenberg-Marquardt from many starts, in kernels or numpy; projection onto regions; tracking."""
