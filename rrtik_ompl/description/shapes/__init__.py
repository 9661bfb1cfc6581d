"""Files of solids: meshes, clouds of points, grids of heights, octrees; each gives a shape."""
