// Obstacles beside what never moves, such as the base of the arm, which the kernels do not compare. An obstacle is a convex
// solid: the hull of corners, each with a disc across an axis, and a ball around every point of that. What stands still are
// such solids too, or the triangles of a mesh; of a mesh of very many triangles they are pieces around it.
const APART_ROUNDS = 100;  // of the search for the distance of two solids; then they count as touching
const ROUNDING = 1e-9;  // [m]
const ANGLE_OF_HALF = 2 * Math.PI;  // solid angle of half a sphere

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

const beside = (a, axis) => { const along = dot(a, axis); return a.map((value, i) => value - along * axis[i]); };
const unit = (a) => { const length = norm(a); return length > 0 ? a.map((value) => value / length) : a; };

/** The point of a solid's core that lies farthest in a direction. */
function farthest({ corners, axis, disc }, direction) {
  let best = corners[0];
  for (const corner of corners) if (dot(corner, direction) > dot(best, direction)) best = corner;
  if (disc === 0) return best;
  const across = unit(beside(unit(beside(direction, axis)), axis));  // twice, for rounding leaves much of an axis where a direction is nearly along it
  return best.map((value, i) => value + disc * across[i]);
}

/** Shares of three edges at most whose sum with a first point is nearest to the origin, on the flat through all of them; null where they are no basis. */
function sharesOf(first, edges) {
  const rest = [];  // the edges, each made orthogonal to those before it
  const shares = edges.map((edge) => {
    let left = edge;
    for (const other of rest) left = minus(left, other.map((value) => (value * dot(left, other)) / dot(other, other)));
    rest.push(left);
    return dot(left, left) > 1e-24 * dot(edge, edge) ? -dot(first, left) / dot(left, left) : NaN;
  });
  for (let k = edges.length - 2; k >= 0; k -= 1) {  // from orthogonal directions back to the edges
    for (let m = k + 1; m < edges.length; m += 1) shares[k] -= (shares[m] * dot(edges[m], rest[k])) / dot(rest[k], rest[k]);
  }
  return shares.every(Number.isFinite) ? shares : null;
}

/** The point of the hull of up to four points that is nearest to the origin, and those that it lies between. */
function nearestOf(points) {
  let best = null;
  for (let set = 1; set < 1 << points.length; set += 1) {
    const [first, ...others] = points.filter((_, k) => set & (1 << k));
    const edges = others.map((other) => minus(other, first));
    const shares = sharesOf(first, edges);
    if (shares === null || shares.some((share) => share < 0) || shares.reduce((sum, share) => sum + share, 0) > 1) continue;
    const at = edges.reduce((sum, edge, k) => sum.map((value, i) => value + shares[k] * edge[i]), first);
    if (best === null || dot(at, at) < dot(best.at, best.at)) best = { at, points: [first, ...others] };
  }
  return best;
}

/** Whether the cores of two solids are surely more than a distance apart. Source: [35], with every subset of the simplex tried. */
function surelyApart(a, b, distance) {
  let simplex = [minus(a.corners[0], b.corners[0])];
  let [nearest] = simplex;
  for (let n = 0; n < APART_ROUNDS; n += 1) {
    const length = norm(nearest);
    if (length <= distance) return false;
    const further = minus(farthest(a, nearest.map((value) => -value)), farthest(b, nearest));
    if (dot(nearest, further) > distance * length) return true;
    const found = [[...simplex, further], [nearest, further]].map(nearestOf).find(({ at }) => norm(at) < length);  // the second where rounding spoils the first
    if (found === undefined) return false;
    simplex = found.points.length < 4 ? found.points : [found.at];  // the origin is inside, or they are flat
    nearest = found.at;
  }
  return false;
}

/** Rows of three whole numbers, as page_fixed.py packs them. */
function wholeRows(bytes) {
  const count = bytes.length / 12;
  const at = (k) => [0, 1, 2, 3].reduce((sum, plane) => sum | (bytes[3 * count * plane + k] << (8 * plane)), 0);
  return Array.from({ length: count }, (_, k) => [at(k), at(count + k), at(2 * count + k)]);
}

/** The triangles of the meshes among what stands still, unpacked. */
async function unpackSurfaces(plan) {
  const meshes = plan.fixed.flatMap(({ surfaces }) => surfaces).filter(({ corners }) => typeof corners === "string");
  await Promise.all(meshes.map(async (surface) => {
    const [corners, faces] = await Promise.all([unpacked(surface.corners), unpacked(surface.faces)]);
    surface.corners = wholeRows(corners).flatMap((row) => row.map((value) => value * surface.grain));
    let first = 0;
    surface.faces = wholeRows(faces).flatMap(([step, second, third]) => { first += step; return [first, first + second, first + third]; });
    if (surface.enclosed) surface.enclosed.cells = await unpacked(surface.enclosed.cells);
  }));
}

/** Corners of a triangle of a mesh. */
function triangleOf({ corners, faces }, k) {
  return [0, 1, 2].map((i) => { const first = 3 * faces[3 * k + i]; return [corners[first], corners[first + 1], corners[first + 2]]; });
}

/** Whether a mesh touches an obstacle's solid, or has it inside; `ends` are points of the obstacle at the ends of its axes. */
function surfaceTouches(surface, solid, radius, ends) {
  const reach = radius + surface.grain + ROUNDING;
  const [low, high] = [-1, 1].map((way) => [0, 1, 2].map((i) => {
    const direction = [0, 0, 0];
    direction[i] = way;
    return farthest(solid, direction)[i] + way * reach;
  }));
  for (let k = 0; k < surface.faces.length / 3; k += 1) {
    const corners = triangleOf(surface, k);
    const near = [0, 1, 2].every((i) => Math.min(...corners.map((c) => c[i])) <= high[i] && Math.max(...corners.map((c) => c[i])) >= low[i]);
    if (near && !surelyApart(solid, { corners, axis: [0, 0, 1], disc: 0 }, reach)) return true;
  }
  return surface.enclosed ? isEnclosed(surface.enclosed, ends) : isInside(surface, solid.corners[0]);
}

/** Whether an open mesh encloses an obstacle that it does not touch; see enclosure.py and containment.py. */
function isEnclosed({ into, low, high, origin, size, shape, cells }, ends) {
  const local = ends.map((end) => [0, 1, 2].map((i) => dot(into.slice(4 * i, 4 * i + 3), end) + into[4 * i + 3]));
  if (local.some((end) => end.some((value, i) => value < low[i] - ROUNDING || value > high[i] + ROUNDING))) return false;
  return local.some((end) => {
    const [x, y, z] = end.map((value, i) => Math.floor((value - origin[i]) / size));
    return cells[(x * shape[1] + y) * shape[2] + z] === 1;
  });
}

/** The ends of an obstacle's own axes. */
function endsOf(obstacle, pose) {
  const halves = [0, 1, 2].map((i) => Math.max(...obstacle.corners.map((corner) => corner[i])) + (i < 2 ? obstacle.disc : 0) + obstacle.radius);
  return [0, 1, 2].flatMap((k) => [-1, 1].map((way) => column(pose, 3).map((value, i) => value + way * halves[k] * pose[4 * i + k])));
}

/** Whether a closed mesh has a point inside, by its winding number. Sources: [37], [38]. */
function isInside(surface, point) {
  let angle = 0;
  for (let k = 0; k < surface.faces.length / 3; k += 1) {
    const [a, b, c] = triangleOf(surface, k).map((corner) => minus(corner, point));
    const [la, lb, lc] = [a, b, c].map(norm);
    angle += 2 * Math.atan2(dot(a, cross(b, c)), la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb);
  }
  return Math.abs(angle) > ANGLE_OF_HALF;
}

const sameNumbers = (a, b) => a.every((value, k) => value === b[k]);

/** The part of the arm that an obstacle touches where it is now, or cannot be said not to; null if none. Where it was when the page was made, Python has looked. What stands still has no margins, as in Python. */
function partTouched(plan, obstacle, pose) {
  const made = plan.obstacles.find(({ name }) => name === obstacle.name);
  if (sameNumbers(pose, made.pose) && sameNumbers(obstacle.sizes, made.sizes)) return null;
  const solid = { corners: placedCorners(obstacle, pose), axis: column(pose, 2), disc: obstacle.disc };
  const touches = (other) => !surelyApart(solid, other, obstacle.radius + other.radius + ROUNDING);
  const meets = ({ solids, surfaces }) => solids.some(touches) || surfaces.some((each) => surfaceTouches(each, solid, obstacle.radius, endsOf(obstacle, pose)));
  return plan.fixed.find((part) => part.meets.includes(obstacle.name) && meets(part))?.name ?? null;
}
