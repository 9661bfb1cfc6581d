"""Clouds of points in kernels: the tree that they walk, which of its points are near, and depth pictures."""
