"""Proofs of motions: what they cost, what they find, and certificates made, verified and tampered with."""
