"""MB-RRT: inverse kinematics by a random tree in the workspace, whose nodes are joints and whose edges are links.

Source: the MB-RRT paper. The published planar variants (`variants`, `growth`, `c_space`), the same in space, sampling
on the arc of intersection (`arc`), two links closed exactly (`closing`), and real arms with one-axis joints, joint
limits and obstacles (`axes`, `axis_tree`).
"""
