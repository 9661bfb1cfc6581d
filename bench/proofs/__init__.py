"""Proofs of motions: what they cost and what they find."""
