"""Elements of a page in three.js: arm, scene, trail, marks, colours, and the first viewpoint."""
