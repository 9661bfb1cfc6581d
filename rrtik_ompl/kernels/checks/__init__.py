"""Collision checks of configurations and motions in kernels, and the same in numpy as the reference."""
