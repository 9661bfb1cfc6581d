"""Solids, the pairs that must not touch, and spheres around solids."""
