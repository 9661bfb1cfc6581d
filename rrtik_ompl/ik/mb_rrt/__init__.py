"""MB-RRT: inverse kinematics by a random tree in the workspace, whose nodes are joints and whose edges are links.

The published planar variants [3] are in `published`. Here alone: the same in space, trees that end exactly on the goal
(`exact`), and real arms with one-axis joints, joint limits and obstacles (`axes`, `workspace_tree`, `search`).
"""
