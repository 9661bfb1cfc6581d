"""Large scenes: thousands of boxes, clouds of points, threads, clusters."""
