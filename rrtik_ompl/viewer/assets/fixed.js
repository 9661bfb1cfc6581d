// Obstacles beside what never moves, such as the base of the arm, which the kernels do not compare. Both are convex solids:
// the hull of corners, each with a disc across an axis, and a ball around every point of that.
const APART_ROUNDS = 400;  // of the search for the distance of two solids; then they count as touching

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];

/** The point of a solid's core that lies farthest in a direction. */
function farthest({ corners, axis, disc }, direction) {
  let best = corners[0];
  for (const corner of corners) if (dot(corner, direction) > dot(best, direction)) best = corner;
  if (disc === 0) return best;
  const along = dot(direction, axis);
  const across = direction.map((value, i) => value - along * axis[i]);
  const length = norm(across);
  return length > 0 ? best.map((value, i) => value + (disc / length) * across[i]) : best;
}

/** Whether the cores of two solids are surely more than a distance apart. Source: [35], with a segment in place of a simplex. */
function surelyApart(a, b, distance) {
  let nearest = minus(a.corners[0], b.corners[0]);
  for (let n = 0; n < APART_ROUNDS; n += 1) {
    const length = norm(nearest);
    if (length <= distance) return false;
    const further = minus(farthest(a, nearest.map((value) => -value)), farthest(b, nearest));
    if (dot(nearest, further) > distance * length) return true;
    const way = minus(further, nearest);
    const share = Math.min(Math.max(-dot(nearest, way) / dot(way, way), 0), 1);
    if (!(share > 0)) return false;
    nearest = nearest.map((value, i) => value + share * way[i]);
  }
  return false;
}

const sameNumbers = (a, b) => a.every((value, k) => value === b[k]);

/** The part of the arm that an obstacle touches where it is now, or cannot be said not to; null if none. Where it was when the page was made, Python has looked. */
function partTouched(plan, obstacle, pose) {
  const made = plan.obstacles.find(({ name }) => name === obstacle.name);
  if (sameNumbers(pose, made.pose) && sameNumbers(obstacle.sizes, made.sizes)) return null;
  const solid = { corners: placedCorners(obstacle, pose), axis: column(pose, 2), disc: obstacle.disc };
  const touches = (other) => !surelyApart(solid, other, obstacle.radius + obstacle.margin + other.radius);
  return plan.fixed.find(({ meets, solids }) => meets.includes(obstacle.name) && solids.some(touches))?.name ?? null;
}
