"""Collision checks of configurations and motions in kernels."""
