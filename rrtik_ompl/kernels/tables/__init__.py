"""What kernels read: the layout of their tables, and the packers that fill them in Python."""
