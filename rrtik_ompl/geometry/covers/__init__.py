"""Sphere covers and convex pieces of solids, made once a robot and cached. No kernels: an edit recompiles none."""
