"""Markers photographed by a synthetic camera, and the drawing over camera pictures."""
