"""C-RDT and BiCRDT in kernels: trees whose every edge moves one joint."""
