"""Read descriptions of robots (URDF with SRDF and joint limits, MJCF, DH tables): each becomes a tree, then a `Robot`.

`load_robot` in `rrtik_ompl.description.catalog` is the public interface to all of this.
"""
