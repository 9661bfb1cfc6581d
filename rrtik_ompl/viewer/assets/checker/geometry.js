// Triangles: how far two surfaces are from each other, and what lies inside of a closed one.

const UP = [0, 0, 1];
const signs = [-1, 1];
const boxCorners = ([x, y, z]) => signs.flatMap((a) => signs.flatMap((b) => signs.map((c) => [a * x, b * y, c * z])));

// ---- triangles --------------------------------------------------------------------------------------------------

/** The smallest squared distance of two segments a b and c d. */
function segmentsSquared(a, b, c, d) {
  const u = subtract(b, a);
  const v = subtract(d, c);
  const w = subtract(a, c);
  const uu = dot(u, u);
  const uv = dot(u, v);
  const vv = dot(v, v);
  const uw = dot(u, w);
  const vw = dot(v, w);
  const clamp = (value) => Math.min(1, Math.max(0, value));
  const determinant = uu * vv - uv * uv;
  let s = determinant > 1e-14 * uu * vv ? clamp((uv * vw - vv * uw) / determinant) : 0;
  let t = vv > 0 ? clamp((uv * s + vw) / vv) : 0;
  s = uu > 0 ? clamp((uv * t - uw) / uu) : 0;
  t = vv > 0 ? clamp((uv * s + vw) / vv) : 0;
  const way = add(w, subtract(scaled(u, s), scaled(v, t)));
  return dot(way, way);
}

/** The squared distance of a point from the inside of a triangle; infinite if its foot is outside. */
function heightSquared(point, [a, b, c]) {
  const normal = cross(subtract(b, a), subtract(c, a));
  const area = dot(normal, normal);
  if (area === 0) return Infinity;
  const corners = [a, b, c];
  const inside = corners.every((p, k) => dot(cross(subtract(corners[(k + 1) % 3], p), subtract(point, p)), normal) >= 0);
  return inside ? dot(subtract(point, a), normal) ** 2 / area : Infinity;
}

/** Whether a segment goes through a triangle. */
function pierces(from, to, [a, b, c]) {
  const volume = (p, q, r, s) => dot(subtract(p, s), cross(subtract(q, s), subtract(r, s)));
  const above = volume(a, b, c, from);
  const below = volume(a, b, c, to);
  if (above * below > 0 || (above === 0 && below === 0)) return false;
  const sides = [volume(from, to, a, b), volume(from, to, b, c), volume(from, to, c, a)];
  return sides.every((side) => side >= 0) || sides.every((side) => side <= 0);
}

/** The smallest distance of two triangles [m]; 0 if they meet. */
function trianglesDistance(first, second) {
  let least = Infinity;
  for (let k = 0; k < 3; k += 1) {
    const next = (k + 1) % 3;
    if (pierces(first[k], first[next], second) || pierces(second[k], second[next], first)) return 0;
    least = Math.min(least, heightSquared(first[k], second), heightSquared(second[k], first));
    for (let j = 0; j < 3; j += 1) {
      least = Math.min(least, segmentsSquared(first[k], first[next], second[j], second[(j + 1) % 3]));
    }
  }
  return Math.sqrt(least);
}

// ---- surfaces: many triangles in a tree of boxes ----------------------------------------------------------------

const LEAF = 4;

/** A tree of boxes around triangles, [[corner, corner, corner]]: {low, high, triangles} or {low, high, children}. */
function boxTree(triangles) {
  const { low, high } = boxAround(triangles.flat());
  if (triangles.length <= LEAF) return { low, high, triangles };

  // Halves at the middle of the longest side; where all are on one side, by number.
  const sizes = subtract(high, low);
  const axis = sizes.indexOf(Math.max(...sizes));
  const isBelow = ([a, b, c]) => a[axis] + b[axis] + c[axis] < 1.5 * (low[axis] + high[axis]);
  const below = triangles.filter(isBelow);
  const uneven = below.length === 0 || below.length === triangles.length;
  const half = triangles.length >> 1;
  const parts = uneven ? [triangles.slice(0, half), triangles.slice(half)] : [below, triangles.filter((each) => !isBelow(each))];
  return { low, high, children: parts.map(boxTree) };
}

/** The smallest distance of two surfaces, if it is less than a limit [m], and else the limit; the second is at a pose. */
function surfacesDistance(first, second, pose, limit) {
  const between = (a, b) => {
    const centre = moved(pose, middle(b.low, b.high));
    const half = scaled(subtract(b.high, b.low), 0.5);
    const away = [0, 1, 2].map((k) => {
      const reach = Math.abs(pose.turn[k][0]) * half[0] + Math.abs(pose.turn[k][1]) * half[1] + Math.abs(pose.turn[k][2]) * half[2];
      return Math.max(0, a.low[k] - centre[k] - reach, centre[k] - reach - a.high[k]);
    });
    return length(away);
  };

  let least = limit;
  const visit = (a, b) => {
    if (between(a, b) >= least) return;
    if (a.triangles !== undefined && b.triangles !== undefined) {
      const placed = b.triangles.map((each) => each.map((corner) => moved(pose, corner)));
      for (const one of a.triangles) for (const other of placed) least = Math.min(least, trianglesDistance(one, other));
      return;
    }
    const splitsFirst = b.children === undefined || (a.children !== undefined && length(subtract(a.high, a.low)) >= length(subtract(b.high, b.low)));
    const pairs = splitsFirst ? a.children.map((child) => [child, b]) : b.children.map((child) => [a, child]);
    pairs.sort((p, q) => between(...p) - between(...q));
    for (const [p, q] of pairs) visit(p, q);
  };
  visit(first, second);
  return least;
}

/** How often a closed surface goes around a point: 0 outside, 1 or -1 inside (van Oosterom and Strackee 1983). */
function windingNumber(triangles, point) {
  let sum = 0;
  for (const triangle of triangles) {
    const [a, b, c] = triangle.map((corner) => subtract(corner, point));
    const [p, q, r] = [length(a), length(b), length(c)];
    const solid = p * q * r + dot(a, b) * r + dot(b, c) * p + dot(c, a) * q;
    sum += 2 * Math.atan2(dot(a, cross(b, c)), solid);
  }
  return sum / (4 * Math.PI);
}

/** How many of a surface's triangles a ray from a point goes through. */
function crossings(triangles, point, direction) {
  const far = add(point, scaled(direction, 1e4));
  return triangles.filter((triangle) => pierces(point, far, triangle)).length;
}

// Directions along no edge that people draw.
const RAYS = [[0.5377, 0.3188, 0.7806], [-0.8622, 0.4336, 0.2618], [0.3426, -0.6715, -0.6571]];

/**
 * Whether a point is inside a surface: it goes around the point, or, if it is closed, most rays leave through it an odd
 * number of times, so that triangles that face the wrong way hide nothing.
 */
function isInside(triangles, closed, point) {
  if (Math.abs(windingNumber(triangles, point)) > 0.5) return true;
  return closed && RAYS.filter((ray) => crossings(triangles, point, ray) % 2 === 1).length > 1;
}

/** The parts of a mesh that have no corner in common: the numbers of their triangles. */
function connectedParts(triangles) {
  const count = 1 + largestOver(triangles, (each) => Math.max(...each), -1);
  const leader = Int32Array.from({ length: count }, (_, k) => k);
  const find = (k) => {
    while (leader[k] !== k) {
      leader[k] = leader[leader[k]];
      k = leader[k];
    }
    return k;
  };
  for (const each of triangles) for (const k of each) leader[find(k)] = find(each[0]);
  const parts = new Map();
  triangles.forEach((each, number) => {
    const key = find(each[0]);
    if (!parts.has(key)) parts.set(key, []);
    parts.get(key).push(number);
  });
  return [...parts.values()];
}

/** Whether triangles pass each edge equally often in both directions. */
function isClosed(triangles) {
  const edges = new Map();
  for (const each of triangles) {
    for (let k = 0; k < 3; k += 1) {
      const [a, b] = [each[k], each[(k + 1) % 3]];
      const key = a < b ? `${a} ${b}` : `${b} ${a}`;
      edges.set(key, (edges.get(key) ?? 0) + (a < b ? 1 : -1));
    }
  }
  return [...edges.values()].every((count) => count === 0);
}
