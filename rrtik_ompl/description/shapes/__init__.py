"""Read files of solids as shapes: meshes, clouds of points, grids of heights, octrees."""
