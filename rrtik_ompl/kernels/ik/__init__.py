"""Inverse kinematics in kernels: Levenberg-Marquardt, and the branches of closed forms."""
