// Vectors and rigid transforms in double precision. A vector is [x, y, z]; a pose is {turn, at}: the three rows of a
// rotation matrix, and an origin [m].
const IDENTITY = { turn: [[1, 0, 0], [0, 1, 0], [0, 0, 1]], at: [0, 0, 0] };

const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const scaled = (a, factor) => [a[0] * factor, a[1] * factor, a[2] * factor];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const length = (a) => Math.sqrt(dot(a, a));
const middle = (a, b) => scaled(add(a, b), 0.5);

/** A function of an object that computes its value once: the same robots and meshes are asked for again and again. */
function once(make) {
  const known = new WeakMap();
  return (key, ...rest) => {
    if (!known.has(key)) known.set(key, make(key, ...rest));
    return known.get(key);
  };
}

/** The box around points: {low, high}. */
function boxAround(points) {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (const point of points) {
    for (let k = 0; k < 3; k += 1) {
      if (point[k] < low[k]) low[k] = point[k];
      if (point[k] > high[k]) high[k] = point[k];
    }
  }
  return { low, high };
}

/** The largest of a measure of points, or a least value if that is larger. */
function largestOver(points, measure, least) {
  let most = least;
  for (const point of points) most = Math.max(most, measure(point));
  return most;
}

/** The transpose of a rotation, which is its inverse. */
const turnedBack = (turn) => [0, 1, 2].map((k) => [turn[0][k], turn[1][k], turn[2][k]]);

/** A direction turned by a rotation. */
const rotated = (turn, a) => [dot(turn[0], a), dot(turn[1], a), dot(turn[2], a)];

/** A point, given in the frame of a pose, as seen from outside. */
const moved = (pose, point) => add(rotated(pose.turn, point), pose.at);

/** The product of two poses: the second one is given in the frame of the first. */
function chained(first, second) {
  const columns = turnedBack(second.turn);
  return { turn: first.turn.map((row) => columns.map((column) => dot(row, column))), at: moved(first, second.at) };
}

/** The pose that leads back. */
const inverse = ({ turn, at }) => ({ turn: turnedBack(turn), at: scaled(rotated(turnedBack(turn), at), -1) });

/** The pose of the second frame as seen from the first, both given in the same frame. */
function seenFrom(first, second) {
  const back = turnedBack(first.turn);
  const columns = turnedBack(second.turn);
  const turn = back.map((row) => columns.map((column) => dot(row, column)));
  return { turn, at: rotated(back, subtract(second.at, first.at)) };
}

/** The rotation by an angle [rad] about a unit axis (Rodrigues). */
function turnAbout([x, y, z], angle) {
  const c = Math.cos(angle);
  const s = Math.sin(angle);
  const v = 1 - c;
  return [
    [x * x * v + c, x * y * v - z * s, x * z * v + y * s],
    [x * y * v + z * s, y * y * v + c, y * z * v - x * s],
    [x * z * v - y * s, y * z * v + x * s, z * z * v + c],
  ];
}

/** A pose from a position and roll, pitch, yaw about fixed axes [rad], as URDF has them. */
function poseOfAngles(at, [roll, pitch, yaw]) {
  const turns = [turnAbout([0, 0, 1], yaw), turnAbout([0, 1, 0], pitch), turnAbout([1, 0, 0], roll)];
  const turn = turns.reduce((first, second) => chained({ turn: first, at: [0, 0, 0] }, { turn: second, at: [0, 0, 0] }).turn);
  return { turn, at };
}

/** A pose from a position and a quaternion x, y, z, w, which is brought to length 1. */
function poseOfQuaternion(at, quaternion) {
  const size = Math.hypot(...quaternion);
  const [x, y, z, w] = quaternion.map((number) => number / size);
  const turn = [
    [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
    [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
    [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
  ];
  return { turn, at };
}
