"""Clouds of points in kernels: the tree that they walk, and which of its points are near."""
