"""How an arm is described: URDF with SRDF and joint limits, DH tables; each becomes one tree, and the tree a `Robot`.

`load_robot` in `rrtik_ompl.description.catalog` is the face of all this.
"""
