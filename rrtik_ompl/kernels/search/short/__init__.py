"""Short, proven routes to one of some goals, in kernels: the table, the kernels, and the object that owns them."""
