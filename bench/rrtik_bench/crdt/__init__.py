"""C-RDT: what was published, and the runs that are compared with it."""
