// The second checker of motion certificates, version 2: whether a file proves that a robot's motion touches nothing.
//
// It follows docs/science/certificate.md, whose sections the comments name, and shares no code with rrtik-ompl. It
// searches for nothing: the file says what is apart by which plane, and each statement is computed here anew, from the
// checker's own reading of robot and scene. Read numbers.js and geometry.js for the arithmetic, this file for the proof.

const VERSION = 2;
const ROUNDING = 1e-8; // [m] added to every required gap
const MEASURED = 1e-5; // [m] further gap where a distance of surfaces is measured
const DEEPEST = 10; // level of an interval
const MOST = { numbers: 1e6, bodies: 1e5, cuts: 1e5, entries: 1e6, parts: 1e4, constraints: 1e3 };
const FIELDS = ["kind", "version", "robot", "joints", "bodies", "unchecked", "clearance", "self_margin", "waypoints", "motions"];
const FURTHER_FIELDS = ["times", "rates", "tracks", "constraints", "held", "base"];
const ORDERS = 5; // derivatives of a timed motion
const JOINT_FIELDS = ["name", "parent", "pose", "axis", "slides", "gain", "offset"];
const BODY_FIELDS = ["name", "number", "kind", "joint", "pose", "shape", "margin", "padding", "contacts"];

/** A reason why a certificate does not hold. */
class Fault extends Error {}

const refuse = (reason) => { throw new Fault(reason); };
const demand = (condition, reason) => { if (!condition) refuse(reason); };

/**
 * Verify a certificate, the value of its JSON.
 *
 * `own` is what the asker has: {robot, srdf, scene, names, waypoints, timed, clearance}, each null if it is not there;
 * `names` are those of the joints that the waypoints' numbers are of, `timed` has {times, rates}. Without a robot or a
 * scene the model in the file is taken for what it says, and the answer says so. Returns {holds, fault, facts}.
 */
function checkCertificate(certificate, own) {
  try {
    checkForm(certificate); // section 8.1
    const world = worldOf(certificate, own); // 8.2
    demand(certificate.clearance >= (own.clearance ?? 0), `it is for a clearance of ${certificate.clearance} m, not ${own.clearance} m`);
    checkWaypoints(certificate, world, own); // 8.3 and 8.4
    const proof = new Proof(certificate, world);
    proof.checkEntries(); // 8.5
    proof.checkPairs(); // 8.6
    proof.checkInsides(); // 8.7
    checkHeld(world.constraints, world.joints, proof.motions); // 8.8
    return { holds: true, fault: "", facts: world.facts };
  } catch (error) {
    if (error instanceof Fault) return { holds: false, fault: error.message, facts: null };
    throw error;
  }
}

// ---- section 2: the form of the file ----------------------------------------------------------------------------

const isNumber = (value) => typeof value === "number" && Number.isFinite(value);
const isCount = (value, most) => Number.isInteger(value) && value >= 0 && value < most;
const isText = (value) => typeof value === "string";
const areNumbers = (value, count) => Array.isArray(value) && (count === undefined || value.length === count) && value.every(isNumber);
const isObject = (value) => value !== null && typeof value === "object" && !Array.isArray(value);

function checkKeys(value, needed, further, where) {
  demand(isObject(value), `${where}: expected an object`);
  for (const key of needed) demand(Object.hasOwn(value, key), `${where}: no field '${key}'`);
  for (const key of Object.keys(value)) demand(needed.includes(key) || further.includes(key), `${where}: unknown field '${key}'`);
}

function checkForm(file) {
  checkKeys(file, FIELDS, FURTHER_FIELDS, "certificate");
  demand(file.kind === "path_certificate", "it is no certificate of a path");
  demand(file.version === VERSION, `version ${file.version} is not known here`);
  demand(isText(file.robot), "robot: expected text");
  for (const key of ["clearance", "self_margin"]) demand(isNumber(file[key]) && file[key] >= 0, `${key}: expected a number of at least 0`);

  demand(Array.isArray(file.waypoints) && file.waypoints.length > 0, "waypoints: expected at least one");
  const dof = Array.isArray(file.waypoints[0]) ? file.waypoints[0].length : 0;
  demand(dof > 0 && file.waypoints.every((row) => areNumbers(row, dof)), "waypoints: expected rows of as many numbers");
  demand(file.waypoints.length * dof <= MOST.numbers, "waypoints: too many");

  demand(Array.isArray(file.joints), "joints: expected a list");
  file.joints.forEach((joint, k) => {
    const where = `joints[${k}]`;
    checkKeys(joint, JOINT_FIELDS, [], where);
    demand(isText(joint.name) && typeof joint.slides === "boolean" && isNumber(joint.offset), `${where}: name, slides or offset is of a wrong type`);
    demand(isCount(joint.parent, k + 1), `${where}: its parent must come before it`);
    demand(areNumbers(joint.pose, 12) && areNumbers(joint.axis, 3) && areNumbers(joint.gain, dof), `${where}: wrong numbers`);
  });

  demand(file.tracks === undefined || (Array.isArray(file.tracks) && file.tracks.length > 0 && file.tracks.length <= MOST.bodies), "tracks: expected a list, not too long");
  const tracks = file.tracks?.length ?? 0;
  demand(Array.isArray(file.bodies) && file.bodies.length <= MOST.bodies, "bodies: expected a list, not too long");
  const carrierOf = new Map(); // of each name, what and on which joint it is
  const numbered = new Set();
  file.bodies.forEach((body, k) => {
    const where = `bodies[${k}]`;
    checkKeys(body, BODY_FIELDS, ["cuts"], where);
    demand(isText(body.name) && isCount(body.number, MOST.bodies) && ["link", "obstacle", "attached"].includes(body.kind), `${where}: name, number or kind`);
    const carriers = file.joints.length + 1 + (body.kind === "obstacle" ? tracks : 0);
    demand(isCount(body.joint, carriers) && areNumbers(body.pose, 12) && isObject(body.shape), `${where}: joint, pose or shape`);
    demand([body.margin, body.padding].every((value) => isNumber(value) && value >= 0), `${where}: margin or padding`);
    demand(Array.isArray(body.contacts) && body.contacts.every((each) => Array.isArray(each) && each.length === 2 && isText(each[0]) && isNumber(each[1])), `${where}: contacts`);
    checkShape(body.shape, where);
    const cuts = body.cuts ?? [];
    demand(Array.isArray(cuts) && cuts.length <= MOST.cuts, `${where}: cuts`);
    cuts.forEach((cut, n) => demand(Array.isArray(cut) && cut.length === 3 && isCount(cut[0], 2 * n + 1) && isCount(cut[1], 3) && isNumber(cut[2]), `${where}: cut ${n}`));
    const carrier = `${body.kind} ${body.joint}`;
    demand((carrierOf.get(body.name) ?? carrier) === carrier, `${where}: '${body.name}' is the name of another thing too`);
    carrierOf.set(body.name, carrier);
    demand(!numbered.has(`${body.name} ${body.number}`), `${where}: '${body.name}' has two bodies of number ${body.number}`);
    numbered.add(`${body.name} ${body.number}`);
  });
  for (const { name, kind, contacts } of file.bodies) {
    const links = kind === "link" ? contacts.filter(([other]) => carrierOf.get(other)?.startsWith("link")) : [];
    demand(links.length === 0, `contacts: '${name}' and '${links[0]?.[0]}' are links`);
  }

  checkConstraintForm(file.constraints, file.joints);
  demand(file.held === undefined || (isObject(file.held) && Object.values(file.held).every(isNumber)), "held: expected values of joints by name");
  demand(file.base === undefined || (areNumbers(file.base, 12) && isRigid(poseOf(file.base))), "base: expected a pose");
  demand(Array.isArray(file.unchecked), "unchecked: expected a list");
  const count = file.bodies.length;
  for (const pair of file.unchecked) demand(Array.isArray(pair) && pair.length === 3 && isCount(pair[1], count) && isCount(pair[0], pair[1]) && isText(pair[2]), "unchecked: expected rows [i, j, reason] with i < j");

  const motions = Math.max(1, file.waypoints.length - 1);
  demand(Array.isArray(file.motions) && file.motions.length === motions && file.motions.every(Array.isArray), `motions: expected a list of ${motions} lists`);
  demand(file.motions.reduce((sum, motion) => sum + motion.length, 0) <= MOST.entries, "motions: too many entries");
  file.motions.forEach((motion, m) => motion.forEach((entry, k) => {
    const where = `motions[${m}][${k}]`;
    demand(Array.isArray(entry) && [4, 6, 9].includes(entry.length) && entry.every(isNumber), `${where}: expected 4, 6 or 9 numbers`);
    const whole = entry.slice(0, 6);
    demand(whole.every((value) => isCount(value, 2 ** 31)), `${where}: expected whole numbers`);
    const [level, number] = whole.slice(-2);
    demand(level <= DEEPEST && number < 2 ** level, `${where}: no interval ${number} of level ${level}`);
  }));

  checkTimes(file, dof);
}

/** The fields of timed motions. */
function checkTimes({ times, rates, tracks, waypoints }, dof) {
  const count = waypoints.length;
  demand((times === undefined) === (rates === undefined), "times and rates: one of them is missing");
  demand(times !== undefined || tracks === undefined, "tracks: obstacles move where motions have times");
  if (times === undefined) return;
  demand(count > 1 && areNumbers(times, count) && times.every((time, k) => k === 0 || time > times[k - 1]), "times: expected as many as waypoints, ascending");
  demand(Array.isArray(rates) && rates.length === count - 1 && rates.every(Array.isArray), "rates: expected a list for each motion");
  const orders = rates[0].length;
  demand(orders >= 1 && orders <= ORDERS && rates.every((row) => row.length === orders && row.every((each) => areNumbers(each, dof))), `rates: expected 1 to ${ORDERS} derivatives for each motion`);
  for (const track of tracks ?? []) demand(Array.isArray(track) && track.length === count && track.every((pose) => areNumbers(pose, 12) && isRigid(poseOf(pose))), "tracks: expected a pose for each waypoint");
}

const SHAPE_FORMS = {
  box: [(value) => areNumbers(value, 3), []],
  sphere: [isNumber, []],
  capsule: [(value) => areNumbers(value, 2), []],
  cylinder: [(value) => areNumbers(value, 2), []],
  half_space: [(value) => areNumbers(value, 4), []],
  hull: [(value) => isCount(value, 2 ** 31), ["radius", "extents"], ["points"]],
  mesh: [(value) => isCount(value, 2 ** 31), ["extents"]],
  balls: [(value) => isCount(value, 2 ** 31), ["radius", "moments", "extents"]],
  boxes: [(value) => isCount(value, 2 ** 31), ["moments", "extents"]],
};

function checkShape(shape, where) {
  const kind = Object.keys(SHAPE_FORMS).find((key) => Object.hasOwn(shape, key));
  demand(kind !== undefined, `${where}: a shape that is not known here`);
  const [fits, further, optional = []] = SHAPE_FORMS[kind];
  checkKeys(shape, [kind, ...further], optional, `${where}: shape`);
  demand(fits(shape[kind]), `${where}: ${kind} has wrong numbers`);
  if (further.includes("extents")) demand(areNumbers(shape.extents, 14), `${where}: expected 14 extents`);
  if (further.includes("moments")) demand(areNumbers(shape.moments, 9), `${where}: expected 9 moments`);
  const points = shape.points ?? [];
  demand(Array.isArray(points) && points.every((point) => areNumbers(point, 3)), `${where}: points`);
  if (further.includes("radius")) demand(isNumber(shape.radius) && shape.radius >= 0, `${where}: radius`);
}

// ---- section 3: the model ---------------------------------------------------------------------------------------

/** The checker's own {joints, bodies}, in the order of those of the file, and what of it was read. */
function readingOf(file, own) {
  const [robot, scene] = [own.robot ?? null, own.scene ?? null];
  const padding = own.padding ?? {};
  const stated = statedJoints(file);
  const base = poseOf(file.base ?? poseNumbers(IDENTITY));
  if (robot !== null) checkStance(file, base, own);
  const arm = robot === null ? { joints: stated, carriers: statedCarriers(file, scene) } : armOf(robot, columnNames(file, robot), file.held ?? {}, base, stated);
  const links = robot === null ? null : linkBodies(robot, arm, padding);
  const others = scene === null ? null : sceneBodies(scene, arm, padding, file.tracks !== undefined);

  // The file's bodies, one after the other: read, where a robot or a scene was given, else as the file states them.
  const next = new Map([[links, 0], [others, 0]]);
  const bodies = file.bodies.map((body) => {
    // Contacts are the scene's, those of links too.
    const contacts = scene === null ? body.contacts : contactsOf(scene, body.name);
    const list = body.kind === "link" ? links : others;
    if (list === null) return { ...statedBody(body), contacts, read: false };
    const number = next.get(list);
    next.set(list, number + 1);
    demand(number < list.length, `it is for another ${ownerOf(body)}: '${body.name}' is in the certificate alone`);
    return { ...list[number], contacts, read: true };
  });
  for (const [list, number] of next) {
    if (list !== null && number < list.length) refuse(`it is for another ${ownerOf(list[number])}: '${list[number].name}' is not in the certificate`);
  }
  const tracks = (file.tracks ?? []).map((track) => track.map(poseOf));
  return { joints: arm.joints, carriers: arm.carriers, bodies, tracks, readRobot: robot !== null, readScene: scene !== null };
}

/** The robot stands, and holds its joints, where the asker says: at the origin and at rest if nothing is said. */
function checkStance(file, base, own) {
  demand(near(poseNumbers(base), poseNumbers(own.base ?? IDENTITY)), `it is for another robot: its base stands at ${base.at.join(", ")}, which nothing here says (robot: {base_pose: ...} of a problem)`);
  const held = file.held ?? {};
  const words = Object.entries(held).map(([name, value]) => `${name} at ${value}`).join(", ");
  demand(sameValues(held, own.held ?? {}), `it is for another robot: held are ${words || "no joints"}, which is not what is said here (robot: {locked: ...} of a problem)`);
}

const sameValues = (one, other) => Object.keys(one).length === Object.keys(other).length && Object.keys(one).every((key) => Math.abs(one[key] - other[key]) <= SAME);

const ownerOf = (body) => (body.kind === "link" ? "robot" : "scene");

/** Joints, bodies, the pairs that must be apart and path constraints, after comparison with what the file says of them: section 3. */
function worldOf(file, own) {
  const { joints, carriers, bodies, tracks, readRobot, readScene } = readingOf(file, own);
  const difference = readRobot ? jointsDifference(file.joints, joints) : "";
  demand(difference === "", `it is for another robot: ${difference}`);
  file.bodies.forEach((body, k) => {
    const other = bodies[k].read ? bodyDifference(body, bodies[k]) : "";
    demand(other === "", `it is for another ${ownerOf(body)}: ${other}`);
  });
  const elsewhere = readScene ? tracksDifference(file, own.scene, tracks) : "";
  demand(elsewhere === "", `it is for another scene: ${elsewhere}`);
  const { constraints, tips } = checkListed(file, own, joints, carriers);
  const selfMargin = readScene ? own.scene.selfMargin : file.self_margin;
  demand(Math.abs(file.self_margin - selfMargin) <= SAME, `it is for a self margin of ${file.self_margin} m, not ${selfMargin} m`);

  const isCompared = (a, b) => a.joint !== b.joint && a.name !== b.name && !(a.kind === "obstacle" && b.kind === "obstacle");
  const reading = { robot: own.robot ?? null, srdf: own.srdf ?? null, scene: own.scene ?? null, joined: readRobot ? joinedLinks(own.robot) : [] };
  const unchecked = new Map();
  for (const [i, j, reason] of file.unchecked) {
    if (!isCompared(bodies[i], bodies[j])) continue;
    checkUnchecked(bodies[i], bodies[j], reason, joints, reading);
    unchecked.set(`${i} ${j}`, [bodies[i].name, bodies[j].name, reason]);
  }

  const pairs = [];
  for (let i = 0; i < bodies.length; i += 1) {
    for (let j = i + 1; j < bodies.length; j += 1) {
      if (isCompared(bodies[i], bodies[j]) && !unchecked.has(`${i} ${j}`)) pairs.push(pairOf(i, j, file, joints, bodies));
    }
  }
  return { joints, bodies, tracks, pairs, constraints, facts: { readRobot, readScene, tips, pairs: pairs.length, unchecked: [...unchecked.values()] } };
}

/** Names of the joints that the numbers of a waypoint are of: those with a gain of 1 that follow no other. */
function columnNames(file, robot) {
  return file.waypoints[0].map((_, column) => {
    const found = file.joints.find(({ name, gain, offset }) => offset === 0 && gain.every((value, k) => value === (k === column ? 1 : 0))
      && robot.joints.some((joint) => joint.name === name && joint.follows === null));
    return found === undefined ? refuse(`it is for another robot: no joint of this one moves by number ${column + 1} of the waypoints`) : found.name;
  });
}

/** What carries attached objects where the robot is as the file states it: the links have no frames of their own there. */
function statedCarriers(file, scene) {
  const held = (scene === null ? [] : scene.attached).map((item) => [item, file.bodies.find((body) => body.kind === "attached" && body.name === item.name)]);
  return new Map(held.filter(([, body]) => body !== undefined).map(([item, body]) => [item.link, { joint: body.joint, pose: chained(poseOf(body.pose), inverse(item.placement)) }]));
}

/** A body as the file states it. */
function statedBody(body) {
  const shape = statedShape(body.shape);
  demand(shape !== null, `'${body.name}' has the shape of a file: give the ${ownerOf(body)} with its meshes and clouds`);
  demand(isRigid(poseOf(body.pose)), `'${body.name}': its pose is not rigid`);
  return { ...body, pose: poseOf(body.pose), shape, solid: solidsOf(shape, true)[0] };
}

/** Refuse a pair that is not compared unless this reading of robot and scene allows that. */
function checkUnchecked(first, second, reason, joints, reading) {
  const ofRobot = first.kind === "link" && second.kind === "link";
  // Of what is taken from the file this is believed too; the verdict says so.
  if ((ofRobot ? reading.robot : reading.scene) === null || allowance(first, second, reading) !== "") return;
  const pair = `'${first.name}' and '${second.name}'`;
  demand(ofRobot && reason === "always touching", `${pair} are not compared ("${reason}"), and nothing here allows that`);
  demand(alwaysTouch(first, second, joints, rangesOf(joints)), `${pair} are not compared, but do not always touch`);
}

/** The distance that two bodies must keep, and how an entry names them: sections 4 and 6. */
function pairOf(i, j, file, joints, bodies) {
  const [a, b] = [bodies[i], bodies[j]];
  const obstacle = [a, b].find((body) => body.kind === "obstacle");
  const usual = (obstacle === undefined ? file.self_margin : obstacle.margin) + a.padding + b.padding;
  const touching = a.contacts.filter(([name]) => name === b.name).map(([, distance]) => distance);
  const inContact = touching.length > 0 && b.contacts.length > 0;
  const kept = inContact ? Math.min(usual, ...touching) : usual + (obstacle === undefined ? 0 : file.clearance);
  // What nothing moves cannot give way: an obstacle that passes it must not touch it, and that is all.
  const passes = Math.min(a.joint, b.joint) === 0 && Math.max(a.joint, b.joint) >= joints.length;
  const gap = passes ? Math.min(0, kept) : kept;

  const base = commonJoint(joints, a.joint, b.joint);
  const isSecond = (body, other) => body.solid.plane !== undefined || (body.joint === base && other.solid.plane === undefined);
  const [first, second] = isSecond(b, a) ? [i, j] : [j, i];
  // How deep two overlap is measured between convex solids.
  const divided = gap >= 0 || !(a.solid.surface || b.solid.surface);
  return { first, second, base, gap, divided, rests: bodies[second].joint === base };
}

// ---- section 3.4: parts of bodies -------------------------------------------------------------------------------

/** The nodes of a body's tree: {elements, children, points, low, high, centre, radius, size}. */
function nodesOf(body, cuts) {
  const { points, elements, disc, radius } = body.solid;
  const centreAlong = (element, axis) => {
    let [least, most] = [Infinity, -Infinity];
    for (const k of element) {
      least = Math.min(least, points[k][axis]);
      most = Math.max(most, points[k][axis]);
    }
    return 0.5 * (least + most);
  };
  const lastNodeOf = new Int32Array(points.length).fill(-1); // of each point, so that no node has it twice
  const nodes = [{ elements, children: null }];
  for (const [k, [node, axis, coordinate]] of cuts.entries()) {
    demand(nodes[node].children === null, `'${body.name}': cut ${k} divides a part twice`);
    const [below, above] = [[], []];
    for (const element of nodes[node].elements) (centreAlong(element, axis) < coordinate ? below : above).push(element);
    nodes[node].children = [nodes.length, nodes.length + 1];
    nodes.push({ elements: below, children: null }, { elements: above, children: null });
  }

  for (const [number, node] of [...nodes.entries()].reverse()) {
    node.points = [];
    for (const element of node.elements) {
      for (const k of element) {
        if (lastNodeOf[k] !== number) node.points.push(points[k]);
        lastNodeOf[k] = number;
      }
    }
    const reach = [radius + disc, radius + disc, radius];
    const { low, high } = boxAround(node.points);
    node.low = subtract(low, reach);
    node.high = add(high, reach);
    node.centre = middle(node.low, node.high);
    node.radius = largestOver(node.points, (point) => length(subtract(point, node.centre)), 0) + disc + radius;
    const children = (node.children ?? []).map((child) => nodes[child]).filter((child) => child.points.length > 0);
    // By the larger of two parts the maker chooses which one to divide; its balls are around those of parts.
    node.size = number > 0 && children.length > 0 ? Math.max(...children.map((child) => length(subtract(child.centre, node.centre)) + child.size)) : node.radius;
  }
  return nodes;
}

const nodesOfSolid = once(() => new Map()); // by cuts

/** The same; those of a solid and of cuts that were asked for before are kept. */
function knownNodes(body, cuts) {
  const known = nodesOfSolid(body.solid);
  const key = JSON.stringify(cuts);
  if (!known.has(key)) known.set(key, nodesOf(body, cuts));
  return known.get(key);
}

// ---- sections 6 to 8: entries, and whether they are sufficient --------------------------------------------------

/** The intervals that contain one, itself first, each as words: level and number. */
const larger = (level, number) => Array.from({ length: level + 1 }, (_, k) => `${level - k} ${Math.floor(number / 2 ** k)}`);

class Proof {
  constructor(file, { joints, bodies, tracks, pairs }) {
    Object.assign(this, { file, joints, bodies, pairs });
    this.motions = motionsOf(file, joints, tracks);
    this.nodes = bodies.map((body, k) => knownNodes(body, file.bodies[k].cuts ?? []));
    this.pairOf = new Map(pairs.map((pair) => [`${pair.first} ${pair.second}`, pair]));
    this.kept = new Map(); // frames by motion and share, bounds by body, base and motion
    this.shown = file.motions.map(() => new Set()); // of each motion what its entries show: bodies, nodes, interval
  }

  keep(key, make) {
    if (!this.kept.has(key)) this.kept.set(key, make());
    return this.kept.get(key);
  }

  /** The pose of a body in the frame of a joint at a share of a motion. */
  pose(k, base, m, share) {
    const frames = this.keep(`frames ${m} ${share}`, () => this.motions[m].frames(share));
    return this.keep(`pose ${k} ${base} ${m} ${share}`, () => chained(seenFrom(frames[base], frames[this.bodies[k].joint]), this.bodies[k].pose));
  }

  /** How fast both bodies of a pair can be together in a motion, and how curved their motions: {speed, bend}. */
  bounds(pair, m) {
    const [a, b] = [pair.first, pair.second].map((k) => this.keep(`bounds ${k} ${pair.base} ${m}`, () => boundsOf(this.bodies[k], pair.base, this.joints, this.motions[m])));
    return { speed: a.speed + b.speed, bend: a.bend + b.bend };
  }

  /** The gap that both ends of an interval of a width have to exceed. */
  required(pair, m, width) {
    return pair.gap + ROUNDING + (this.bounds(pair, m).bend * width * width) / 8;
  }

  poses(pair, m, shares) {
    return [pair.first, pair.second].map((k) => shares.map((share) => this.pose(k, pair.base, m, share)));
  }

  /** Section 7.1: whether balls and boxes, or a half-space, show two nodes apart on an interval. */
  apartByBalls(pair, a, b, m, begin, width) {
    const [one, other] = [this.nodes[pair.first][a], this.nodes[pair.second][b]];
    const [first, second] = this.poses(pair, m, [begin, begin + width]);
    const required = this.required(pair, m, width);
    const { plane } = this.bodies[pair.second].solid;
    if (this.bodies[pair.first].solid.plane !== undefined) return false;
    if (plane !== undefined) {
      const gaps = first.map((pose, end) => {
        const normal = rotated(second[end].turn, plane.normal);
        return -this.reach(pair.first, one, pose, scaled(normal, -1)) - plane.offset - dot(normal, second[end].at);
      });
      return Math.min(...gaps) > required;
    }

    const [p0, p1] = first.map((pose) => moved(pose, one.centre));
    const [c0, c1] = second.map((pose) => moved(pose, other.centre));
    if (!pair.rests) {
      const between = scaled(subtract(add(p0, p1), add(c0, c1)), 0.5);
      return length(between) - (length(subtract(p1, p0)) + length(subtract(c1, c0))) / 2 - one.radius - other.radius > required;
    }
    const byBall = Math.sqrt(segmentsSquared(p0, p1, c0, c0)) - other.radius - one.radius;
    if (byBall > required) return true;
    const [q0, q1] = [p0, p1].map((point) => rotated(turnedBack(second[0].turn), subtract(point, second[0].at)));
    const byBox = length([0, 1, 2].map((k) => Math.max(0, Math.min(q0[k], q1[k]) - other.high[k], other.low[k] - Math.max(q0[k], q1[k]))));
    return byBox > 0 && byBox - one.radius > required; // boxes that overlap tell nothing of how deep
  }

  /** How far a part reaches along a unit direction, at a pose. */
  reach(k, node, pose, direction) {
    const { disc, radius } = this.bodies[k].solid;
    const own = rotated(turnedBack(pose.turn), direction);
    let height = -Infinity;
    for (const point of node.points) height = Math.max(height, dot(point, own));
    return height + dot(direction, pose.at) + radius + disc * Math.hypot(own[0], own[1]);
  }

  /** Section 7.2: whether a plane of that normal separates two nodes on an interval. */
  apartByPlane(pair, a, b, m, begin, width, normal) {
    const size = length(normal);
    if (!(size >= 0.5) || [pair.first, pair.second].some((k) => this.bodies[k].solid.plane !== undefined)) return false;
    const unit = scaled(normal, 1 / size);
    const [first, second] = this.poses(pair, m, [begin, begin + width]);
    const low = Math.min(...first.map((pose) => -this.reach(pair.first, this.nodes[pair.first][a], pose, scaled(unit, -1))));
    const high = Math.max(...second.map((pose) => this.reach(pair.second, this.nodes[pair.second][b], pose, unit)));
    return low - high > this.required(pair, m, width);
  }

  /** Section 7.4: whether two whole bodies are farther apart in the middle than they can approach each other. */
  apartByDistance(pair, m, begin, width) {
    const solids = [pair.first, pair.second].map((k) => this.bodies[k]);
    if (pair.gap < 0 || solids.some((body) => body.solid.plane !== undefined || body.shape.kind === "hull")) return false;
    const required = pair.gap + ROUNDING + MEASURED + (this.bounds(pair, m).speed * width) / 2;
    const [[first], [second]] = this.poses(pair, m, [begin + width / 2]);
    return solidsDistance(solids[0], solids[1], seenFrom(first, second), 1.01 * required + MEASURED) > required;
  }

  describe(pair, m, begin, width) {
    const [a, b] = [pair.first, pair.second].map((k) => `'${this.bodies[k].name}'`);
    return `motion ${m + 1}: ${a} and ${b}, from ${begin} to ${begin + width} of it`;
  }

  /** Section 8.5: each entry holds; they are kept by the parts and the interval that they are about. */
  checkEntries() {
    this.file.motions.forEach((entries, m) => {
      for (const entry of entries) {
        const measured = entry.length === 4;
        const [i, a, j, b, level, number] = measured ? [entry[0], 0, entry[1], 0, ...entry.slice(2)] : entry;
        const pair = this.pairOf.get(`${i} ${j}`);
        demand(pair !== undefined, `motion ${m + 1}: an entry names no compared pair: ${i} and ${j}`);
        demand(a < this.nodes[i].length && b < this.nodes[j].length, `motion ${m + 1}: an entry names a part that is not there`);
        demand(pair.divided || (a === 0 && b === 0 && !measured), `motion ${m + 1}: an entry divides a mesh that may overlap`);

        const width = 0.5 ** level;
        const begin = number * width;
        const holds = this.isEmpty(i, a) || this.isEmpty(j, b) || (measured
          ? this.apartByDistance(pair, m, begin, width)
          : entry.length === 9
            ? this.apartByPlane(pair, a, b, m, begin, width, entry.slice(6))
            : this.apartByBalls(pair, a, b, m, begin, width));
        demand(holds, `${this.describe(pair, m, begin, width)}: not shown apart by an entry`);

        this.shown[m].add(`${i} ${a} ${j} ${b} ${level} ${number}`);
      }
    });
  }

  isEmpty(k, node) {
    return this.nodes[k][node].points.length === 0 && this.bodies[k].solid.plane === undefined;
  }

  /** Section 8.6: each pair is apart in each motion, by its entries or by balls and boxes. */
  checkPairs() {
    for (let m = 0; m < this.motions.length; m += 1) {
      for (const pair of this.pairs) demand(this.isShown(pair, 0, 0, m, 0, 0), `${this.describe(pair, m, 0, 1)}: not shown apart`);
    }
  }

  /** SHOW: whether two nodes are shown apart on an interval; parts and time are divided in the order of section 8.6. */
  isShown(pair, a, b, m, level, number) {
    const { first: i, second: j } = pair;
    const width = 0.5 ** level;
    if (this.isEmpty(i, a) || this.isEmpty(j, b) || this.apartByBalls(pair, a, b, m, number * width, width)) return true;
    const isEntry = (x, y, interval) => this.shown[m].has(`${i} ${x} ${j} ${y} ${interval}`);
    if (larger(level, number).some((interval) => isEntry(a, b, interval) || isEntry(0, 0, interval))) return true;

    const [one, other] = [this.nodes[i][a], this.nodes[j][b]];
    const [sizeOfOne, sizeOfOther] = [one, other].map((node) => (node.points.length === 0 ? 0 : node.size));
    const [dividesOne, dividesOther] = [one, other].map((node) => pair.divided && node.children !== null);
    const sagitta = (this.bounds(pair, m).bend * width * width) / 8;
    if (level < DEEPEST && (sagitta > Math.max(sizeOfOne, sizeOfOther) || !(dividesOne || dividesOther))) {
      return [2 * number, 2 * number + 1].every((half) => this.isShown(pair, a, b, m, level + 1, half));
    }

    const splitOne = () => one.children.every((child) => this.isShown(pair, child, b, m, level, number));
    const splitOther = () => other.children.every((child) => this.isShown(pair, a, child, m, level, number));
    // Either choice is sound; where both are as large, rounding decides which one the maker has taken.
    if (dividesOne && dividesOther && Math.abs(sizeOfOther - sizeOfOne - SAME) <= SAME) return splitOne() || splitOther();
    if (dividesOne && dividesOther) return sizeOfOther > sizeOfOne ? splitOther() : splitOne();
    return dividesOne ? splitOne() : dividesOther && splitOther();
  }

  /** Section 7.3: at the first waypoint nothing is inside of a mesh. */
  checkInsides() {
    for (const pair of this.pairs) {
      if (pair.gap < 0) continue;
      for (const [outer, inner] of [[pair.first, pair.second], [pair.second, pair.first]]) {
        if (!this.bodies[outer].solid.surface || this.bodies[inner].solid.plane !== undefined) continue;
        const pose = seenFrom(this.pose(outer, pair.base, 0, 0), this.pose(inner, pair.base, 0, 0));
        const inside = pointInside(this.bodies[outer], this.bodies[inner], pose);
        demand(!inside, `'${this.bodies[inner].name}' begins inside of '${this.bodies[outer].name}'`);
      }
    }
  }
}
