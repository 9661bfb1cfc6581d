"""Analytic solvers: closed forms that a robot brings, their branches, and planar arms."""
