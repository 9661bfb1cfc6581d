"""Solids, the bodies of a world and the pairs that must not touch; how far an arm moves; the second opinion.

`World` is the face of all this.
"""
