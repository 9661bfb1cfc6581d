"""Compute sphere covers and convex pieces of solids, once per geometry, and cache them.

No kernel but its own depends on the source of these modules, so that an edit recompiles no other.
"""
