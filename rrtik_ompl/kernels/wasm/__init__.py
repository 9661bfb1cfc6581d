"""The kernels as WebAssembly, and tables as an image of a page's memory: how a 3-D page plans by itself."""
