"""SIMD lanes, and kernels as compiled libraries: how they are compiled, kept, loaded and shipped."""
