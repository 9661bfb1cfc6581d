"""Routes pulled taut in a kernel along what they touch: the table, the kernels, and the object that owns them."""
