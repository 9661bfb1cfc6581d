// Section 5: how joints and obstacles go, and how fast and how curved points of bodies go at most.
const LARGEST_VALUE = 1e3; // [rad or m] of a joint
const LIMIT_TOLERANCE = 1e-6; // [rad or m] by which a waypoint may exceed a limit
const JUMP = 1e-9; // [rad or m] between the end of a timed motion and the next waypoint, and between equal motions
const STILL = 1e-12; // up to which two rotations are the same
const LARGEST_TURN = 3.1; // [rad] of an obstacle in a motion: below pi the shortest rotation is beyond doubt

/** Sections 8.3 and 8.4: the motion is the one that is asked about, and its waypoints are inside of limits. */
function checkWaypoints(file, world, own) {
  const { joints } = world;
  const waypoints = own.waypoints ?? null;
  if (waypoints !== null) {
    const same = waypoints.length === file.waypoints.length && waypoints.every((row, k) => row.length === file.waypoints[k].length && row.every((value, j) => value === file.waypoints[k][j]));
    demand(same, "it is for another path: waypoints differ");
    checkColumns(joints, own.names ?? null, waypoints[0].length);
    checkTimed(file, own.timed ?? null);
  }
  for (const [k, row] of file.waypoints.entries()) {
    jointValues(joints, row).forEach((value, j) => {
      demand(Math.abs(value) <= LARGEST_VALUE, `waypoint ${k + 1}: joint '${joints[j].name}' is at ${value}, too far`);
      const driven = joints[j].gain.some((gain) => gain !== 0) && joints[j].follows === null;
      const inside = value >= joints[j].lower - LIMIT_TOLERANCE && value <= joints[j].upper + LIMIT_TOLERANCE;
      demand(!driven || inside, `waypoint ${k + 1}: joint '${joints[j].name}' is at ${value}, outside its limits`);
    });
  }
}

/** The numbers of a waypoint are of the joints that the motion which is asked about names, in that order. */
function checkColumns(joints, names, count) {
  // What a path is written as whose joints have no names fits every robot.
  if (names === null || (names.every((name, k) => name === `joint${k + 1}`) && !names.some((name) => joints.some((joint) => joint.name === name)))) return;
  const isMoved = (name, column) => joints.some((joint) => joint.name === name && joint.offset === 0 && joint.gain.every((gain, k) => gain === (k === column ? 1 : 0)));
  demand(names.length === count && names.every(isMoved), `it is for another path: that which is asked about moves ${names.join(", ")}`);
}

/** Between the waypoints, which are the same, the motion is that which is asked about: straight, or by these rates. */
function checkTimed(file, timed) {
  demand((timed === null) === (file.times === undefined), "it is for another motion: one of them is timed, and the other a path");
  if (timed === null) return;
  const { times, rates } = timed;
  demand(times.length === file.times.length && times.every((time, k) => time === file.times[k]), "it is for another motion: times differ");
  file.rates.forEach((row, m) => row[0].forEach((_, j) => {
    const coefficients = [row, rates[m]].map((each) => powersOf(each.map((rate) => rate[j]), times[m + 1] - times[m]));
    const apart = Array.from({ length: ORDERS }, (_, k) => Math.abs((coefficients[0][k] ?? 0) - (coefficients[1][k] ?? 0)));
    demand(apart.reduce((sum, value) => sum + value, 0) <= JUMP, "it is for another motion: rates differ");
  }));
}

/** Coefficients of the powers 1, 2, ... of the share of a motion that takes a time h, of derivatives by time. */
function powersOf(rates, h) {
  let factor = 1;
  return rates.map((rate, k) => {
    factor *= h / (k + 1);
    return factor * rate;
  });
}

/** The derivative of a polynomial, of coefficients of the powers from 0. */
const slopeOf = (powers) => powers.slice(1).map((value, k) => (k + 1) * value);

/** A bound of the size of a polynomial for shares from 0 to 1: its largest coefficient in Bernstein's form. */
function largestOf(powers) {
  const degree = powers.length - 1;
  const choose = (n, k) => (k === 0 ? 1 : (choose(n, k - 1) * (n - k + 1)) / k);
  const bernstein = powers.map((_, i) => powers.slice(0, i + 1).reduce((sum, value, k) => sum + (value * choose(i, k)) / choose(degree, k), 0));
  return bernstein.reduce((most, value) => Math.max(most, Math.abs(value)), 0);
}

/**
 * Motions: {frames, rate, bend, stroke, tracks}. `frames(s)` are those of the joints, then of the tracks, at a share;
 * `rate` and `bend` bound the first and second derivative of joint values over s, `stroke` their size.
 */
function motionsOf(file, joints, tracks) {
  const { waypoints, times, rates } = file;
  const rows = waypoints.length === 1 ? [waypoints[0], waypoints[0]] : waypoints;
  return rows.slice(1).map((row, m) => {
    const from = jointValues(joints, rows[m]);
    const to = jointValues(joints, row);
    const h = times === undefined ? 1 : times[m + 1] - times[m];
    const ofJoint = ({ gain }, j) => (times === undefined ? [to[j] - from[j]] : powersOf(rates[m].map((each) => gain.reduce((sum, value, k) => sum + value * each[k], 0)), h));
    const powers = joints.map((joint, j) => [from[j], ...ofJoint(joint, j)]);
    const at = (s) => powers.map((each) => each.reduceRight((value, power) => value * s + power, 0));
    const rate = powers.map((each) => largestOf(slopeOf(each)));
    const bend = powers.map((each) => largestOf(slopeOf(slopeOf(each))));
    const stroke = from.map((value, j) => Math.max(Math.abs(value), Math.abs(to[j])) + (times === undefined ? 0 : rate[j]));
    if (times !== undefined) {
      const ends = at(1);
      demand(to.every((value, j) => Math.abs(value - ends[j]) <= JUMP), `motion ${m + 1} does not end at its waypoint`);
      demand(stroke.every((value) => value <= LARGEST_VALUE), `motion ${m + 1} goes too far`);
    }
    const ways = tracks.map((track) => wayBetween(track[m], track[m + 1], m));
    return { frames: (s) => [...jointFrames(joints, at(s)), ...ways.map((way) => way.at(s))], rate, bend, stroke, tracks: ways };
  });
}

/** How an obstacle goes from a pose to the next one, straight and by the shortest rotation: {at, shift, turn}. */
function wayBetween(from, to, m) {
  const { turn } = seenFrom(from, to);
  const shift = subtract(to.at, from.at);
  const same = turn.every((row, i) => row.every((value, j) => Math.abs(value - (i === j ? 1 : 0)) <= STILL));
  const twice = [turn[2][1] - turn[1][2], turn[0][2] - turn[2][0], turn[1][0] - turn[0][1]];
  const angle = same ? 0 : Math.atan2(length(twice), turn[0][0] + turn[1][1] + turn[2][2] - 1);
  demand(angle <= LARGEST_TURN, `motion ${m + 1}: an obstacle turns by more than ${LARGEST_TURN}`);
  const turned = (s) => (angle === 0 ? IDENTITY.turn : turnAbout(scaled(twice, 1 / length(twice)), s * angle));
  const at = (s) => ({ turn: chained({ turn: from.turn, at: [0, 0, 0] }, { turn: turned(s), at: [0, 0, 0] }).turn, at: add(from.at, scaled(shift, s)) });
  return { at, shift: length(shift), turn: angle };
}

/** How far points of a body are at most from the origin and from the axis of the joint that carries it [m]. */
const reachesOf = once(({ pose, solid }, axis) => {
  const around = solid.disc + solid.radius;
  const toOrigin = largestOver(solid.points, (point) => length(moved(pose, point)), 0) + around;
  return { toOrigin, toAxis: largestOver(solid.points, (point) => length(cross(moved(pose, point), axis)), 0) + around };
});

/** Bounds {speed, bend} of all points of a body in a motion, over s, seen from a joint that carries it: section 5.4. */
function boundsOf(body, base, joints, motion) {
  const { plane } = body.solid;
  if (body.joint === base) return { speed: 0, bend: 0 };
  const way = motion.tracks[body.joint - joints.length];
  if (plane !== undefined) return way?.turn === 0 ? { speed: way.shift, bend: 0 } : { speed: Infinity, bend: Infinity };
  let { toOrigin, toAxis } = reachesOf(body, way === undefined ? joints[body.joint].axis : UP);
  if (way !== undefined) return { speed: way.shift + way.turn * toOrigin, bend: way.turn * way.turn * toOrigin };
  let [speed, bend] = [0, 0];

  for (let k = body.joint; k !== base; k = joints[k].parent) {
    const { slides, placement, parent } = joints[k];
    const [w, b] = [motion.rate[k], motion.bend[k]];
    bend += slides ? b : w * (2 * speed + w * toAxis) + b * toAxis;
    speed += slides ? w : w * toAxis;
    // How far the points are from the axis and the origin of the next joint inwards.
    const stroke = slides ? motion.stroke[k] : 0;
    toAxis = length(cross(placement.at, joints[parent].axis)) + stroke + toOrigin;
    toOrigin += length(placement.at) + stroke;
  }
  return { speed, bend };
}
