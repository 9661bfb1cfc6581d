"""Compute motions over time, and let arms follow them."""
