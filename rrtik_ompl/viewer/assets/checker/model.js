// The checker's own reading of robot and scene as joints and bodies, and whether a certificate is about the same ones.

const SAME = 1e-9; // largest difference of equal numbers
const SAME_EXTENT = 1e-6; // of the extents of meshes, relative to 1 m + size
const POSTURES = 64; // random ones, in which links that always touch have to touch
const TOUCHING = 0.9; // share of them that is sufficient
const DIRECTIONS = [0, 1, 2].flatMap((axis) => [1, -1].map((sign) => [0, 1, 2].map((k) => (k === axis ? sign : 0))))
  .concat(boxCorners([1, 1, 1].map(() => 1 / Math.sqrt(3))));

/** What a thing or link is in contact with, by a scene: [name, distance] each. */
const contactsOf = (scene, name) => scene.contacts.filter(({ pair }) => pair.includes(name)).map(({ pair, distance }) => [pair[0] === name ? pair[1] : pair[0], distance]);

const solidOfLink = once((shape) => solidsOf(shape, true)[0]);

/** The bodies of a robot's links: each solid with its link's joint; numbered within the link. */
function linkBodies(robot, arm, padding) {
  const thickness = (link) => (typeof padding === "number" ? padding : padding[link] ?? 0);
  return robot.solids.map((solid, k) => {
    const carrier = arm.carriers.get(solid.link);
    const number = robot.solids.slice(0, k).filter((other) => other.link === solid.link).length;
    const place = { joint: carrier.joint, pose: chained(carrier.pose, solid.placement) };
    return { name: solid.link, number, kind: "link", ...place, solid: solidOfLink(solid.shape), shape: solid.shape, margin: 0, padding: thickness(solid.link) };
  });
}

/** The bodies of a scene: those of obstacles, on tracks if they move; then attached objects, whose links an arm carries. */
function sceneBodies(scene, arm, padding, tracked) {
  const moving = tracked ? scene.obstacles.filter((each) => each.motion !== null) : [];
  const placeOf = (each) => (moving.includes(each) ? { joint: arm.joints.length + moving.indexOf(each), pose: IDENTITY } : { joint: 0, pose: each.placement });
  const bodiesOf = (each, rest) => solidsOf(each.shape, false).map((solid, number) => ({ name: each.name, number, solid, shape: each.shape, ...rest }));
  const obstacles = scene.obstacles.flatMap((each) => bodiesOf(each, { kind: "obstacle", ...placeOf(each), margin: each.margin, padding: 0 }));
  const attached = scene.attached.flatMap((each) => {
    const carrier = arm.carriers.get(each.link);
    if (carrier === undefined) throw new Error(`attached '${each.name}': the robot has no link '${each.link}'`);
    const own = each.padding ?? (typeof padding === "number" ? padding : padding[each.link] ?? 0);
    return bodiesOf(each, { kind: "attached", joint: carrier.joint, pose: chained(carrier.pose, each.placement), margin: 0, padding: own + each.margin });
  });
  return [...obstacles, ...attached];
}

/** Pairs of names of links with solids that one joint joins; frames without solids belong to what they are fixed to. */
function joinedLinks(robot) {
  const solid = new Set(robot.solids.map((each) => each.link));
  const fixed = robot.joints.filter((joint) => joint.kind === "fixed");
  const nearest = (link) => {
    const found = new Set();
    const seen = new Set([link]);
    const waiting = [link];
    while (waiting.length > 0) {
      const next = waiting.pop();
      if (solid.has(next)) {
        found.add(next);
        continue;
      }
      for (const joint of fixed) {
        const other = joint.parent === next ? joint.child : joint.child === next ? joint.parent : null;
        if (other !== null && !seen.has(other)) {
          seen.add(other);
          waiting.push(other);
        }
      }
    }
    return [...found];
  };
  return robot.joints.filter((joint) => joint.kind !== "fixed").flatMap((joint) => {
    const [below, above] = [nearest(joint.child), nearest(joint.parent)];
    return below.length === 1 && above.length === 1 ? [[below[0], above[0]]] : [];
  });
}

/**
 * Why two bodies need not be compared, by this reading of robot, SRDF and scene: a word, or "" if nothing allows it.
 */
function allowance(first, second, { robot, srdf, scene, joined }) {
  const among = (pairs) => pairs.some(([a, b]) => (a === first.name && b === second.name) || (b === first.name && a === second.name));
  if (scene !== null && among(scene.allowed)) return "allowed by the scene";
  for (const item of scene === null ? [] : scene.attached) {
    const other = first.name === item.name ? second.name : second.name === item.name ? first.name : null;
    if (other !== null && (other === item.link || item.allow.includes(other))) return "allowed by the scene";
  }
  if (robot === null || first.kind !== "link" || second.kind !== "link") return "";
  const never = srdf !== null && (among(srdf.never) || ((srdf.disabled.includes(first.name) || srdf.disabled.includes(second.name)) && !among(srdf.enabled)));
  if (never) return "allowed by the robot";
  return among(joined) && !(srdf !== null && among(srdf.enabled)) ? "adjacent" : "";
}

/** Whether two links touch in nearly all of many random postures, so that their shapes overlap by construction. */
function alwaysTouch(first, second, joints, ranges) {
  let state = 1;
  const random = () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 2 ** 32;
  };
  let touching = 0;
  for (let k = 0; k < POSTURES; k += 1) {
    const waypoint = ranges.map(([low, high]) => low + random() * (high - low));
    const frames = jointFrames(joints, jointValues(joints, waypoint));
    const pose = seenFrom(chained(frames[first.joint], first.pose), chained(frames[second.joint], second.pose));
    if (solidsDistance(first, second, pose, 1e-3) <= 0) touching += 1;
  }
  return touching >= TOUCHING * POSTURES;
}

// ---- the model in the file against this reading -----------------------------------------------------------------

const poseNumbers = ({ turn, at }) => [0, 1, 2].flatMap((k) => [...turn[k], at[k]]);
const poseOf = (numbers) => ({ turn: [0, 1, 2].map((k) => numbers.slice(4 * k, 4 * k + 3)), at: [3, 7, 11].map((k) => numbers[k]) });
const isRigid = ({ turn }) => turn.every((row, i) => turn.every((other, j) => Math.abs(dot(row, other) - (i === j ? 1 : 0)) <= 1e-6));
const near = (a, b, tolerance = SAME) => a.length === b.length && a.every((value, k) => Math.abs(value - b[k]) <= tolerance);

/** The support function of a solid's points in 14 directions, radius and disc left out. */
const extentsOf = once((solid) => DIRECTIONS.map((direction) => largestOver(solid.points, (point) => dot(point, direction), -Infinity)));

/** Why a shape in the file is not this one: a few words, or "". */
function shapeDifference(stated, body) {
  const { solid, shape } = body;
  const numbers = {
    box: () => [stated.box, scaled(shape.half ?? [], 2)],
    sphere: () => [[stated.sphere], [shape.radius]],
    capsule: () => [stated.capsule, [shape.radius, 2 * shape.half]],
    cylinder: () => [stated.cylinder, [shape.radius, 2 * shape.half]],
    half_space: () => [stated.half_space, [...(shape.normal ?? []), shape.offset]],
  };
  const kind = Object.keys(stated)[0];
  if (Object.hasOwn(numbers, kind)) {
    if (shape.kind !== kind) return `it is a ${kind} there, a ${shape.kind} here`;
    return near(...numbers[kind]()) ? "" : "its sizes differ";
  }

  const fits = { hull: ["mesh", "polygon"], mesh: ["mesh"], balls: ["points"], boxes: ["boxes"] }[kind] ?? [];
  if (!fits.includes(shape.kind)) return `it is ${kind} there, a ${shape.kind} here`;
  const extents = extentsOf(solid);
  const size = 1 + Math.max(...extents.map(Math.abs));
  if (!near(extents, stated.extents, SAME_EXTENT * size)) return "its extents differ";
  if (kind !== "boxes" && kind !== "mesh" && Math.abs(stated.radius - solid.radius) > SAME) return "its radius differs";
  return ["balls", "boxes"].includes(kind) && stated[kind] !== solid.elements.length ? "it has another number of elements" : "";
}

/** What a body is in the words of a file, without its cuts. */
function bodyDifference(stated, body) {
  if (stated.name !== body.name || stated.number !== body.number || stated.kind !== body.kind) {
    return `'${stated.name}' ${stated.number} (${stated.kind}) there is '${body.name}' ${body.number} (${body.kind}) here`;
  }
  const where = `'${body.name}'`;
  if (stated.joint !== body.joint) return `${where} is carried by another joint`;
  if (!near(stated.pose, poseNumbers(body.pose))) return `${where} is at another pose`;
  if (Math.abs(stated.margin - body.margin) > SAME) return `${where} has a margin of ${stated.margin} m there, ${body.margin} m here`;
  if (Math.abs(stated.padding - body.padding) > SAME) return `${where} has a padding of ${stated.padding} m there, ${body.padding} m here`;
  const words = (contacts) => contacts.map(([name, distance]) => `${name} ${distance}`).sort().join("; ");
  if (words(stated.contacts) !== words(body.contacts)) return `${where} has other contacts`;
  const difference = shapeDifference(stated.shape, body);
  return difference === "" ? "" : `${where}: ${difference}`;
}

/** Why obstacles do not move as the file says: a few words, or "". */
function tracksDifference(file, scene, tracks) {
  const moving = scene.obstacles.filter((each) => each.motion !== null);
  if (tracks.length !== (file.tracks === undefined ? 0 : moving.length)) return "other obstacles move";
  if (file.tracks === undefined) return moving.length === 0 ? "" : `'${moving[0].name}' moves, and the certificate is of obstacles at rest`;
  if (moving.length === 0) return "nothing moves here";
  const { times } = file;
  for (const [k, { name, motion, placement }] of moving.entries()) {
    const turns = motion.times.find((time) => time > times[0] && time < times[times.length - 1] && !times.includes(time));
    if (turns !== undefined) return `'${name}' changes its way at ${turns} s, between two waypoints`;
    const same = times.every((time, n) => near(poseNumbers(tracks[k][n]), poseNumbers(poseAt(motion, placement, time))));
    if (!same) return `'${name}' moves otherwise`;
  }
  return "";
}

/** The pose of an obstacle that moves, {velocity, times, poses}, at a time; `placement` is that at time 0. */
function poseAt({ velocity, times, poses }, placement, time) {
  if (velocity !== null) return { turn: placement.turn, at: add(placement.at, scaled(velocity, time)) };
  const next = times.findIndex((each) => each > time);
  if (next <= 0) return poses[next < 0 ? poses.length - 1 : 0];
  return wayBetween(poses[next - 1], poses[next], 0).at((time - times[next - 1]) / (times[next] - times[next - 1]));
}

/** Why the joints in the file are not these: a few words, or "". */
function jointsDifference(stated, joints) {
  if (stated.length !== joints.length - 1) return `it has ${stated.length} joints that move, and ${joints.length - 1} here`;
  for (const [k, one] of stated.entries()) {
    const own = joints[k + 1];
    const where = `joint '${one.name}'`;
    if (one.name !== own.name) return `${where} is '${own.name}' here`;
    if (one.parent !== own.parent || one.slides !== own.slides) return `${where} is carried, or moves, otherwise`;
    if (!near(one.pose, poseNumbers(own.placement)) || !near(one.axis, own.axis)) return `${where} has another frame or axis`;
    if (!near(one.gain, own.gain) || Math.abs(one.offset - own.offset) > SAME) return `${where} follows the waypoints otherwise`;
  }
  return "";
}

/** The joints that a file describes, as the checker has them; the world first. */
function statedJoints(certificate) {
  const dof = certificate.waypoints[0].length;
  const world = { name: "", parent: -1, placement: IDENTITY, axis: UP, slides: false, gain: Array(dof).fill(0), offset: 0, lower: -Infinity, upper: Infinity };
  return [world, ...certificate.joints.map((one) => {
    const placement = poseOf(one.pose);
    if (!isRigid(placement) || Math.abs(length(one.axis) - 1) > 1e-6) throw new Fault(`joint '${one.name}': its pose is not rigid, or its axis no unit vector`);
    return { ...one, placement, lower: -Infinity, upper: Infinity };
  })];
}

/** The shape that a file states, if numbers are all there is of it; null if it needs a file of its own. */
function statedShape(stated) {
  if (stated.box !== undefined) return { kind: "box", half: scaled(stated.box, 0.5) };
  if (stated.sphere !== undefined) return { kind: "sphere", radius: stated.sphere };
  const [kind] = ["capsule", "cylinder"].filter((each) => stated[each] !== undefined);
  if (kind !== undefined) return { kind, radius: stated[kind][0], half: stated[kind][1] / 2 };
  if (stated.half_space !== undefined) return { kind: "half_space", normal: stated.half_space.slice(0, 3), offset: stated.half_space[3] };
  if (stated.points !== undefined) return { kind: "hull", corners: stated.points };
  return null;
}
