// Path constraints: regions that frames do not leave in whole motions (sections 3.5, 5.6 and 7.5).
const CONSTRAINT_FIELDS = ["frame", "joint", "pose", "within", "region", "bounds", "tolerances"];
const ALLOWED = 1e-8; // [m or rad] beyond tolerances
const ENDLESS = 1000; // [m]; positions are free if all their bounds are of this size or more
const FULL = 2 * Math.PI - 1e-9; // [rad]; a range of this size or more leaves its angle free
const STEEPEST = 1.55; // [rad] of pitch, beside ranges of angles

function checkConstraintForm(constraints, joints) {
  if (constraints === undefined) return;
  demand(Array.isArray(constraints) && constraints.length > 0 && constraints.length <= MOST.constraints, "constraints: expected a list, neither empty nor too long");
  constraints.forEach((each, k) => {
    const where = `constraints[${k}]`;
    checkKeys(each, CONSTRAINT_FIELDS, [], where);
    demand(isText(each.frame) && isCount(each.joint, joints.length + 1), `${where}: frame or joint`);
    demand(["pose", "within", "region"].every((key) => areNumbers(each[key], 12) && isRigid(poseOf(each[key]))), `${where}: expected three poses`);
    demand(Array.isArray(each.bounds) && each.bounds.length === 6 && each.bounds.every((pair) => areNumbers(pair, 2) && pair[0] <= pair[1]), `${where}: expected six pairs of bounds`);
    demand(areNumbers(each.tolerances, 2) && each.tolerances.every((value) => value >= 0), `${where}: expected two tolerances`);
  });
}

/**
 * Section 3.5: refuse constraints other than those that are asked for, and frames that are elsewhere here.
 *
 * Returns the constraints {frame, joint, ...} as they are asked for, or as the file has them where nothing was given,
 * and the names of frames that are believed to be the robot's tip, as nothing that was given names it.
 */
function checkListed(file, own, joints, carriers) {
  const listed = file.constraints ?? [];
  const asked = own.scene?.constraints ?? null;
  demand(asked === null || asked.length === listed.length, `it is for other path constraints: it lists ${listed.length} of them, and ${asked?.length} are asked for`);
  const frames = jointFrames(joints, jointValues(joints, own.begin ?? file.waypoints[0]));
  const tips = new Set();
  const constraints = listed.map((stated, k) => {
    const differs = (what) => refuse(`it is for other path constraints: ${what} of number ${k + 1}, of '${stated.frame}'`);
    const held = own.scene?.attached.find(({ name }) => name === stated.frame);
    const carrier = carriers.get(held === undefined ? stated.frame : held.link);
    const place = held === undefined || carrier === undefined ? carrier : { joint: carrier.joint, pose: chained(carrier.pose, held.placement) };
    // Without a robot, or of things that only a scene describes, the file is believed.
    const isTold = (own.scene ?? null) === null && file.bodies.some(({ name, kind }) => kind === "attached" && name === stated.frame);
    if (place === undefined && (own.robot ?? null) !== null && !isTold) differs("no such frame here");
    if (place !== undefined && (place.joint !== stated.joint || !near(stated.pose, poseNumbers(place.pose)))) differs("the frame is elsewhere here");
    const pose = place === undefined ? poseOf(stated.pose) : place.pose;
    if (asked === null) return { ...stated, pose: poseNumbers(pose) };

    const { frame, fromStart, region, within, bounds, tolerances } = asked[k];
    const name = frame ?? own.tip ?? null;
    if (name === null) tips.add(stated.frame);
    else if (name !== stated.frame) differs("another frame");
    const placed = fromStart ? chained(chained(frames[stated.joint], pose), region) : region;
    if (!near(stated.region, poseNumbers(placed)) || !near(stated.within, poseNumbers(within))) differs("another pose");
    if (!near(stated.bounds.flat(), bounds.flat())) differs("other bounds");
    if (!near(stated.tolerances, tolerances)) differs("other tolerances");
    return { ...stated, pose: poseNumbers(pose), within: poseNumbers(within), region: poseNumbers(placed), bounds, tolerances };
  });
  demand(tips.size <= 1, `it is for other path constraints: ${[...tips].join(" and ")} cannot all be the robot's tip`);
  return { constraints, tips: [...tips] };
}

/** Section 8.8: each constraint is kept in each motion; intervals are halved until that shows. */
function checkHeld(constraints, joints, motions) {
  constraints.forEach((constraint, k) => {
    const held = heldOf(constraint, joints);
    const isWithin = (amounts) => amounts.every((amount, j) => amount <= held.limits[j] + ALLOWED);
    motions.forEach((motion, m) => {
      const keeps = (level, number) => {
        const { ends, highest } = held.outside(motion, number * 0.5 ** level, 0.5 ** level);
        if (isWithin(highest)) return true;
        return isWithin(ends) && level < DEEPEST && keeps(level + 1, 2 * number) && keeps(level + 1, 2 * number + 1);
      };
      demand(keeps(0, 0), `motion ${m + 1}: path constraint ${k + 1}, of '${constraint.frame}', is not shown to be kept`);
    });
  });
}

/** A constraint as {limits, outside}: how far its frame may be outside, and is at the ends of an interval and in it. */
function heldOf({ joint, pose, within, region, bounds, tolerances }, joints) {
  const place = chained(poseOf(pose), poseOf(within));
  const base = poseOf(region);
  const positions = bounds.slice(0, 3);
  const angles = bounds.slice(3);
  const isFree = positions.flat().every((value) => Math.abs(value) >= ENDLESS);
  const turning = turningOf(angles);
  const point = { joint, pose: place, solid: { points: [[0, 0, 0]], disc: 0, radius: 0 } };

  const distance = ({ at }) => length(positions.map(([low, high], k) => at[k] - Math.min(high, Math.max(low, at[k]))));
  const outside = (motion, begin, width) => {
    const [first, last] = [begin, begin + width].map((share) => seenFrom(base, chained(motion.frames(share)[joint], place)));
    const { bend } = boundsOf(point, 0, joints, motion);
    const { turn, push } = turnBounds(joint, joints, motion);
    const turned = turning(first.turn, last.turn, turn * width, push * width * width);
    const far = [distance(first), distance(last)];
    return {
      ends: [Math.max(...far), turned.most],
      highest: [highestOf(far, bend * width * width), highestOf(turned.ends, turned.curved)],
    };
  };
  const angle = turning.chords ? 2 * Math.sin(Math.min(tolerances[1], Math.PI) / 2) : tolerances[1];
  return { limits: [isFree ? Infinity : tolerances[0], angle], outside };
}

/** How fast the frame of a joint turns at most, and what joints' accelerations add to that: {turn, push}. */
function turnBounds(joint, joints, motion) {
  let [turn, push] = [0, 0];
  for (let k = joint; k !== 0; k = joints[k].parent) {
    if (joints[k].slides) continue;
    turn += motion.rate[k];
    push += motion.bend[k];
  }
  return { turn, push };
}

/** The largest that a convex function can be whose argument is off the line between both ends by a curvature / 8. */
function highestOf([first, last], curved) {
  const bend = curved / 8;
  const way = last - first;
  return Math.abs(way) < 4 * bend ? (first + last) / 2 + bend + (bend < Infinity ? (way * way) / (16 * bend) : 0) : Math.max(first, last);
}

/** How the orientation is measured over an interval in which it turns by `turn` at most: {ends, most of both, curved}. */
function turningOf(angles) {
  const full = angles.map(([low, high]) => high - low >= FULL);
  const single = angles.map(([low, high]) => low === high);
  const count = (marks) => marks.filter(Boolean).length;
  if (count(full) === 3) return Object.assign(() => ({ ends: [0, 0], most: 0, curved: 0 }), { chords: true });

  const alone = (k) => turnAbout([0, 1, 2].map((j) => (j === k ? 1 : 0)), full[k] ? 0 : angles[k][0]);
  const [x, y, z] = [0, 1, 2].map(alone);
  const product = (...turns) => turns.reduce((one, other) => chained({ turn: one, at: [0, 0, 0] }, { turn: other, at: [0, 0, 0] }).turn);
  if (count(single) === 3) return chordsOf(IDENTITY.turn, turnedBack(product(z, y, x)), Math.SQRT2);
  if (count(full) === 1 && count(single) === 2) {
    const k = full.indexOf(true);
    const [before, after] = [[product(z, y), IDENTITY.turn], [z, x], [IDENTITY.turn, product(y, x)]][k];
    return chordsOf([rotated(turnedBack(after), IDENTITY.turn[k])], [rotated(before, IDENTITY.turn[k])], 1);
  }
  return rangesOfTurn(angles, full);
}

/** By how far directions of the frame are from those that they should have: twice the sine of half the angle. */
function chordsOf(own, ways, size) {
  const measure = (turn) => Math.hypot(...own.map((direction, k) => length(subtract(rotated(turn, direction), ways[k])))) / size;
  const chords = (first, last, turn, push) => {
    const ends = [measure(first), measure(last)];
    return { ends, most: Math.max(...ends), curved: turn * turn + push };
  };
  return Object.assign(chords, { chords: true });
}

/** By how much roll, pitch and yaw together are outside of their ranges. */
function rangesOfTurn(angles, full) {
  const anglesOf = (turn) => [Math.atan2(turn[2][1], turn[2][2]), Math.atan2(-turn[2][0], Math.hypot(turn[0][0], turn[1][0])), Math.atan2(turn[1][0], turn[0][0])];
  const nearest = (values, to) => values.map((value, k) => value - 2 * Math.PI * Math.round((value - to[k]) / (2 * Math.PI)));
  const excess = (values) => values.reduce((sum, value, k) => sum + (full[k] ? 0 : Math.max(0, angles[k][0] - value, value - angles[k][1])), 0);
  return (first, last, turn, push) => {
    // Angles of the first end are those nearest to the ranges, and of the last end those nearest to the first's.
    const middles = angles.map(([low, high]) => (low + high) / 2);
    const one = nearest(anglesOf(first), middles);
    const other = nearest(anglesOf(last), one);
    const most = Math.max(excess(one), excess(nearest(anglesOf(last), middles)));
    const pitch = Math.max(Math.abs(one[1]), Math.abs(other[1])) + turn / 2;
    const steep = 1 / Math.cos(pitch);
    const isSound = pitch < STEEPEST && steep * turn < Math.PI;
    const curved = 3 * (steep * ((turn * turn) / 2 + push) + 2 * steep * steep * turn * turn);
    return { ends: [excess(one), excess(other)], most, curved: isSound ? curved : Infinity };
  };
}
