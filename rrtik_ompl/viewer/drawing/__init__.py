"""What a page shows as three.js draws it: arm, scene, trail, marks, colours, the first viewpoint."""
