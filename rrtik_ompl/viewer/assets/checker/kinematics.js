// The joints of a robot that move, parents first, and where they are: forward kinematics.

/**
 * An arm {joints, carriers} of a robot: the joints that move, parents first, and what carries each link: {joint, pose}.
 *
 * `names` are the joints of the waypoints' columns, `held` values of joints that stand still [rad or m] by name (0, or
 * the limit next to it, where it has none), `base` the pose of the root link. Joints come in the order of those that are
 * `stated`, and have their frames where those are this robot's frames turned. Joint 0 is the world. A joint has {parent, placement, axis, slides, gain, offset, lower, upper}: its
 * value is gain * waypoint + offset.
 */
function armOf(robot, names, held, base, stated = []) {
  const root = robot.links.find((link) => robot.joints.every((joint) => joint.child !== link));
  const carriers = new Map([[root, { joint: 0, pose: base }]]);
  const joints = [{ name: "", parent: -1, placement: IDENTITY, axis: UP, slides: false, gain: names.map(() => 0), offset: 0 }];
  const unknown = names.find((name) => !robot.joints.some((joint) => joint.name === name && joint.kind !== "fixed" && joint.follows === null));
  if (unknown !== undefined) throw new Error(`the robot has no joint '${unknown}' that moves by itself`);

  // Those that are not stated stand still, and come before what they carry.
  const order = stated.map((joint) => joint.name);
  const waiting = [...robot.joints].sort((a, b) => order.indexOf(a.name) - order.indexOf(b.name));
  while (waiting.length > 0) {
    const next = waiting.findIndex((joint) => carriers.has(joint.parent));
    if (next < 0) throw new Error(`link '${waiting[0].parent}' hangs on nothing`);
    const [joint] = waiting.splice(next, 1);
    const carrier = carriers.get(joint.parent);
    const placement = chained(carrier.pose, joint.placement);
    const { gain, offset } = ruleOf(robot, joint, names, held);
    if (gain.every((value) => value === 0)) {
      carriers.set(joint.child, { joint: carrier.joint, pose: chained(placement, jointMotion(joint, offset)) });
    } else {
      const turn = turnBetween(placement, joint.axis, stated.find((other) => other.name === joint.name));
      const turned = { turn, at: [0, 0, 0] };
      const axis = rotated(turnedBack(turn), joint.axis);
      joints.push({ ...joint, parent: carrier.joint, placement: chained(placement, turned), axis, slides: joint.kind === "prismatic", gain, offset });
      carriers.set(joint.child, { joint: joints.length - 1, pose: inverse(turned) });
    }
  }
  return { joints, carriers };
}

/** The rotation of a joint's own frame to the one that is stated, which has the same axis in the world; none otherwise. */
function turnBetween(placement, axis, stated) {
  if (stated === undefined) return IDENTITY.turn;
  const { turn } = seenFrom(placement, stated.placement);
  const same = length(subtract(rotated(turn, stated.axis), axis)) < 1e-9;
  const turns = turn.some((row, k) => row.some((value, j) => Math.abs(value - IDENTITY.turn[k][j]) > 1e-9));
  return same && turns ? turn : IDENTITY.turn;
}

/** How the value of a joint follows from a waypoint: {gain, offset}. */
function ruleOf(robot, joint, names, held, seen = []) {
  const still = (value) => ({ gain: names.map(() => 0), offset: value });
  if (joint.kind === "fixed") return still(0);
  if (joint.lower === joint.upper && joint.follows === null) return still(joint.lower);
  if (names.includes(joint.name)) return { gain: names.map((name) => (name === joint.name ? 1 : 0)), offset: 0 };
  if (Object.hasOwn(held, joint.name)) return still(held[joint.name]);
  const leader = joint.follows === null ? undefined : robot.joints.find((other) => other.name === joint.follows.joint);
  if (leader === undefined) return still(Math.min(Math.max(0, joint.lower), joint.upper));
  if (seen.includes(joint.name)) throw new Error(`joint '${joint.name}' follows itself`);

  const { gain, offset } = ruleOf(robot, leader, names, held, [...seen, joint.name]);
  const { multiplier, offset: own } = joint.follows;
  return { gain: gain.map((value) => multiplier * value), offset: multiplier * offset + own };
}

/** The motion of a joint by a value [rad or m]. */
function jointMotion(joint, value) {
  const slides = joint.slides ?? joint.kind === "prismatic";
  return slides ? { turn: IDENTITY.turn, at: scaled(joint.axis, value) } : { turn: turnAbout(joint.axis, value), at: [0, 0, 0] };
}

/** Values of all joints at a waypoint, the world's first. */
const jointValues = (joints, waypoint) => joints.map(({ gain, offset }) => gain.reduce((sum, value, k) => sum + value * waypoint[k], 0) + offset);

/** Poses of all joints in the world at values of theirs, the world itself first. */
function jointFrames(joints, values) {
  const frames = [IDENTITY];
  for (let k = 1; k < joints.length; k += 1) {
    frames.push(chained(chained(frames[joints[k].parent], joints[k].placement), jointMotion(joints[k], values[k])));
  }
  return frames;
}

/** The last joint that carries both, 0 for the world, which carries the tracks: these have greater numbers than joints. */
function commonJoint(joints, first, second) {
  let [a, b] = [first, second];
  const parent = (k) => joints[k]?.parent ?? 0;
  while (a !== b) [a, b] = a > b ? [parent(a), b] : [a, parent(b)];
  return a;
}

/** The range that each number of a waypoint is drawn from: the limits of the joint that it moves, or a whole turn. */
const rangesOf = (joints) => joints[0].gain.map((_, column) => {
  const joint = joints.find(({ gain, follows }) => (follows ?? null) === null && gain[column] === 1);
  const limits = joint === undefined ? [-Infinity, Infinity] : [joint.lower, joint.upper];
  return limits.every(Number.isFinite) ? limits : [-Math.PI, Math.PI];
});
