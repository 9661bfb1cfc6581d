"""Installing: what resolvers say for other machines, wheels made for a measurement."""
