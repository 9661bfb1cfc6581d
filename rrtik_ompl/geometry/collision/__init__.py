"""Model the bodies of a world and the pairs that must not touch, bound the arm's motion, and check a second time.

`World` is the public interface to all of this.
"""
