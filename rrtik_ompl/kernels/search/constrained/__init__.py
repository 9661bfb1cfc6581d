"""Searches along path constraints in kernels: projection onto regions, and trees that grow along them."""
