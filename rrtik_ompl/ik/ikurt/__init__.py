"""IKURT, extended inverse kinematics by a random tree: from a posture to a pose of the tip, with the path to it.

Source: [1, ch. 5.1]. A tree grows in joint space from the start; the metric that draws it is that of the workspace,
so that the configurations at the goal need not be known.
"""
