"""Routes pulled taut in a kernel: the table, the kernel, and the object that keeps it between two calls."""
