"""Roadmaps in kernels: free configurations joined by motions, which queries of one world share."""
