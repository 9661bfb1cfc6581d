"""C-RDT [1, ch. 6.3]: what was published, and the runs that are compared with it."""
