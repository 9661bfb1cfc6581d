"""Proofs of paths in files, and a verifier that shares no computation with what made them."""
