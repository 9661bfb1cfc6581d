"""Immutable values: the arm, its surroundings, goals, paths, proofs and settings."""
