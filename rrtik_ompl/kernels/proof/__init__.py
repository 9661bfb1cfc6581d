"""Proofs in kernels that whole motions are free, not only points of them."""
