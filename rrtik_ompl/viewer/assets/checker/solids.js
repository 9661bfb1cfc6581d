// Solids of all kinds as the checker compares them: points, the elements that are hulls of them, and what is around.
//
// A solid is {points, elements, radius, disc, surface}: the union of all that is within `radius` of the hull of the points
// of an element, each with a disc of radius `disc` across z around it. `surface` is true where elements are triangles of
// a mesh, whose inside is not part of the solid. A half-space is {plane: {normal, offset}}.

const bare = { radius: 0, disc: 0, surface: false };

/** Boxes along the axes, each {centre, half}, as one solid. */
function boxesSolid(boxes) {
  const points = boxes.flatMap(({ centre, half }) => boxCorners(half).map((corner) => add(centre, corner)));
  const elements = boxes.map((_, k) => [0, 1, 2, 3, 4, 5, 6, 7].map((corner) => 8 * k + corner));
  return { ...bare, points, elements };
}

/** The solids that a shape is, in its frame: one, or several of a prism or of a mesh that is closed in parts. */
function solidsOf(shape, ofLink) {
  const one = (points, rest) => [{ ...bare, points, elements: [points.map((_, k) => k)], ...rest }];
  if (shape.kind === "box") return [boxesSolid([{ centre: [0, 0, 0], half: shape.half }])];
  if (shape.kind === "sphere") return one([[0, 0, 0]], { radius: shape.radius });
  const ends = [[0, 0, shape.half], [0, 0, -shape.half]];
  if (shape.kind === "capsule") return one(ends, { radius: shape.radius });
  if (shape.kind === "cylinder") return one(ends, { disc: shape.radius });
  if (shape.kind === "half_space") return [{ ...bare, points: [], elements: [], plane: { normal: shape.normal, offset: shape.offset } }];
  if (shape.kind === "polygon") {
    const levels = [-0.5 * shape.height, 0.5 * shape.height];
    return convexPolygons(shape.corners).flatMap((part) => one(levels.flatMap((z) => part.map(([x, y]) => [x, y, z]))));
  }
  if (shape.kind === "hull") return one(shape.corners);
  if (shape.kind === "points") return [{ ...bare, points: shape.points, elements: shape.points.map((_, k) => [k]), radius: shape.radius }];
  if (shape.kind === "boxes") return [boxesSolid(shape.boxes)];
  if (shape.kind === "mesh") {
    const whole = { ...bare, points: shape.corners, elements: shape.triangles, surface: true };
    return ofLink ? [whole] : closedFirst(whole);
  }
  throw new Error(`a shape of kind '${shape.kind}' is not known here`);
}

/** A mesh as one solid, or, if some of its parts are closed and others not, as two. */
function closedFirst(mesh) {
  const parts = connectedParts(mesh.elements).map((numbers) => numbers.map((k) => mesh.elements[k]));
  const kinds = [true, false].map((closed) => parts.filter((part) => isClosed(part) === closed).flat());
  return kinds.some((kind) => kind.length === 0) ? [mesh] : kinds.map((elements) => withOwnPoints(mesh, elements));
}

/** Some of a mesh's triangles with the points that they use. */
function withOwnPoints(mesh, elements) {
  const used = [...new Set(elements.flat())];
  const numbers = new Map(used.map((k, number) => [k, number]));
  return { ...mesh, points: used.map((k) => mesh.points[k]), elements: elements.map((element) => element.map((k) => numbers.get(k))) };
}

// ---- polygons ---------------------------------------------------------------------------------------------------

const turnOf = (p, q, r) => (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);

/** Convex polygons that a simple one is divided into: by cutting ears, then joining neighbours, first ones first. */
function convexPolygons(given) {
  const corners = given.filter((corner, k) => corner.some((value, axis) => value !== given[(k + 1) % given.length][axis]));
  const area = corners.reduce((sum, [x, y], k) => sum + x * corners[(k + 1) % corners.length][1] - corners[(k + 1) % corners.length][0] * y, 0);
  const all = corners.map((_, k) => k);
  const ring = area > 0 ? all : all.reverse();
  const at = (list, k) => corners[list[((k % list.length) + list.length) % list.length]];
  const isConvex = (list) => list.every((_, k) => turnOf(at(list, k), at(list, k + 1), at(list, k + 2)) >= 0);
  if (isConvex(ring)) return [ring.map((k) => corners[k])];

  const rest = [...ring];
  const parts = [];
  while (rest.length > 3) {
    const ear = rest.findIndex((_, k) => {
      const [p, q, r] = [at(rest, k - 1), at(rest, k), at(rest, k + 1)];
      const inside = (o) => turnOf(p, q, o) >= 0 && turnOf(q, r, o) >= 0 && turnOf(r, p, o) >= 0;
      return turnOf(p, q, r) > 0 && !rest.some((other) => ![p, q, r].includes(corners[other]) && inside(corners[other]));
    });
    const flatness = rest.map((_, k) => Math.abs(turnOf(at(rest, k - 1), at(rest, k), at(rest, k + 1))));
    const cut = ear >= 0 ? ear : flatness.indexOf(Math.min(...flatness));
    if (ear >= 0) parts.push([rest[(cut + rest.length - 1) % rest.length], rest[cut], rest[(cut + 1) % rest.length]]);
    rest.splice(cut, 1);
  }
  parts.push(rest);

  const joined = (first, second) => {
    for (let k = 0; k < first.length; k += 1) {
      const [a, b] = [first[k], first[(k + 1) % first.length]];
      const m = second.findIndex((value, j) => value === b && second[(j + 1) % second.length] === a);
      if (m >= 0) {
        const around = second.map((_, j) => second[(m + 1 + j) % second.length]);
        const union = [...first.slice(0, k + 1), ...around.slice(1, -1), ...first.slice(k + 1)];
        return isConvex(union) ? union : null;
      }
    }
    return null;
  };
  for (let i = 0; i < parts.length; i += 1) {
    for (let j = i + 1; j < parts.length; j += 1) {
      const union = joined(parts[i], parts[j]);
      if (union !== null) {
        parts[i] = union;
        parts.splice(j, 1);
        [i, j] = [0, 0]; // begin anew with the first two
      }
    }
  }
  return parts.map((part) => part.map((k) => corners[k]));
}

// ---- distances of whole solids ----------------------------------------------------------------------------------

const CYLINDER_SIDES = 96; // of the prism around a cylinder: it sticks out by 0.05 % of the radius
const BOX_FACES = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
const boxTriangles = (corners) => BOX_FACES.flatMap(([a, b, c, d]) => [[a, b, c], [a, c, d]].map((each) => each.map((k) => corners[k])));

/** A prism between two rings of as many points, closed by a fan at either end. */
function prismTriangles(low, high) {
  const sides = low.flatMap((point, k) => {
    const next = (k + 1) % low.length;
    return [[point, low[next], high[next]], [point, high[next], high[k]]];
  });
  const fans = low.slice(2).flatMap((_, k) => [[low[0], low[k + 2], low[k + 1]], [high[0], high[k + 1], high[k + 2]]]);
  return [...sides, ...fans];
}

/** The surface of a body's core in its own frame; what is round has its radius around it beside that. */
function coreTriangles({ shape, solid }) {
  if (solid.surface) return solid.elements.map((element) => element.map((k) => solid.points[k]));
  if (shape.kind === "cylinder") {
    const outer = shape.radius / Math.cos(Math.PI / CYLINDER_SIDES);
    const ring = (z) => Array.from({ length: CYLINDER_SIDES }, (_, k) => [outer * Math.cos((2 * Math.PI * k) / CYLINDER_SIDES), outer * Math.sin((2 * Math.PI * k) / CYLINDER_SIDES), z]);
    return prismTriangles(ring(-shape.half), ring(shape.half));
  }
  if (shape.kind === "polygon") {
    const half = solid.points.length / 2;
    return prismTriangles(solid.points.slice(0, half), solid.points.slice(half));
  }
  const corners = (element) => element.map((k) => solid.points[k]);
  if (shape.kind === "box" || shape.kind === "boxes") return solid.elements.flatMap((element) => boxTriangles(corners(element)));
  return solid.elements.map((element) => [0, 1, 2].map((k) => solid.points[element[Math.min(k, element.length - 1)]]));
}

/** What is computed of a body's surface when it is first asked for: box, triangles, their tree, and whether they are closed. */
class Surface {
  constructor(body) {
    this.body = body;
    Object.assign(this, boxAround(body.solid.points));
  }

  keep(name, make) {
    this.kept ??= new Map();
    if (!this.kept.has(name)) this.kept.set(name, make());
    return this.kept.get(name);
  }

  get triangles() { return this.keep("triangles", () => coreTriangles(this.body)); }

  get tree() { return this.keep("tree", () => boxTree(this.triangles)); }

  get closed() { return this.keep("closed", () => !this.body.solid.surface || isClosed(this.body.solid.elements)); }

  /** A point of each component: of each part of a mesh, of each element of anything else. */
  get samples() {
    const { elements, points, surface } = this.body.solid;
    return this.keep("samples", () => (surface ? connectedParts(elements).map(([first]) => elements[first]) : elements).map((element) => points[element[0]]));
  }
}

const surfaces = once((solid, body) => new Surface(body));
const surfaceOf = (body) => surfaces(body.solid, body);

/** Whether a component of the inner body begins inside of the surface of the outer one, in whose frame it has a pose. */
function pointInside(outer, inner, pose) {
  const surface = surfaceOf(outer);
  const { low, high } = surface;
  const [reach, other] = [outer.solid.disc, surfaceOf(inner)];
  // Bodies whose boxes are apart need no look at their parts.
  const centre = moved(pose, middle(other.low, other.high));
  const around = length(subtract(other.high, other.low)) / 2 + reach;
  if (centre.some((value, k) => value + around < low[k] || value - around > high[k])) return false;
  return other.samples.some((sample) => {
    const point = moved(pose, sample);
    const within = point.every((value, k) => value >= low[k] - reach && value <= high[k] + reach);
    return within && isInside(surface.triangles, surface.closed, point);
  });
}

/** The distance of two bodies, if it is less than a limit [m], and else the limit; 0 if one is inside of the other. */
function solidsDistance(first, second, pose, limit) {
  const round = first.solid.radius + second.solid.radius;
  const [a, b] = [surfaceOf(first), surfaceOf(second)];
  const apart = surfacesDistance(a.tree, b.tree, pose, limit + round) - round;
  return apart > 0 && (pointInside(first, second, pose) || pointInside(second, first, inverse(pose))) ? 0 : apart;
}
