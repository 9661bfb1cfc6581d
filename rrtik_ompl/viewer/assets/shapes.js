// Shapes that a page can add and make another size: what their sizes are, and what they mean to the kernels, to a file
// and to the picture. Sizes stand in the order of a problem file.
const SIZE_NAMES = { box: ["size x", "size y", "size z"], sphere: ["radius"], cylinder: ["radius", "length"], capsule: ["radius", "length"] };
const ROUND_PARTS = 32;  // of a circle that is drawn

/** An obstacle of the planner's list in other sizes [m]. */
function resized(obstacle, sizes) {
  const [first, second] = sizes;
  const along = (half) => obstacle.corners.map(([x, y, z]) => [x, y, Math.sign(z) * half]);
  if (obstacle.shape === "box") {
    const half = sizes.map((size) => 0.5 * size);
    return { ...obstacle, sizes, half, corners: obstacle.corners.map((corner) => corner.map((value, i) => Math.sign(value) * half[i])) };
  }
  if (obstacle.shape === "sphere") return { ...obstacle, sizes, radius: first };
  if (obstacle.shape === "capsule") return { ...obstacle, sizes, radius: first, length: 0.5 * second, corners: along(0.5 * second) };
  return { ...obstacle, sizes, disc: first, length: 0.5 * second, corners: along(0.5 * second) };
}

/** The keys of a shape in a problem file. */
function shapeEntry(shape, sizes) {
  if (shape === "box") return { box: sizes };
  if (shape === "sphere") return { sphere: sizes[0] };
  return { [shape]: { radius: sizes[0], length: sizes[1] } };
}

/** Its surface; the axis of what is round is z. */
function shapeGeometry(shape, sizes) {
  const [radius, length] = sizes;
  if (shape === "box") return new THREE.BoxGeometry(...sizes);
  if (shape === "sphere") return new THREE.SphereGeometry(radius, ROUND_PARTS, ROUND_PARTS / 2);
  if (shape === "cylinder") return new THREE.CylinderGeometry(radius, radius, length, ROUND_PARTS).rotateX(Math.PI / 2);
  const cap = (k) => new THREE.Vector2(radius * Math.cos(k), Math.sign(k) * 0.5 * length + radius * Math.sin(k));
  const profile = Array.from({ length: ROUND_PARTS / 2 }, (_, k) => cap(Math.PI * ((k + 0.5) / (ROUND_PARTS / 2) - 0.5)));
  const ends = [-1, 1].map((side) => new THREE.Vector2(0, side * (0.5 * length + radius)));
  return new THREE.LatheGeometry([ends[0], ...profile, ends[1]], ROUND_PARTS).rotateX(Math.PI / 2);
}
