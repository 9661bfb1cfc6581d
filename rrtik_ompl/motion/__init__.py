"""Motions over time, and arms that follow them."""
