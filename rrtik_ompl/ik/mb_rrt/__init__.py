"""MB-RRT: inverse kinematics by a random tree in the workspace, whose nodes are joints and whose edges are links.

The published planar variants [3] are `variants`, `growth` and `c_space`. Here alone: the same in space, sampling on the
arc of intersection (`arc`), two links closed exactly (`closing`), and real arms with one-axis joints, joint limits and
obstacles (`axes`, `workspace_tree`).
"""
