"""What a page shows as meshcat geometries: arm, scene, trail, marks, colours, the first viewpoint."""
