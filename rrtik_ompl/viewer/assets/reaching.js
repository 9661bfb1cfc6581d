// How near an arm comes to a pose that it cannot take: damped least squares within the limits, the place before the turn.
const NEAR_ROUNDS = 60;
const TURN_WEIGHT = 0.01;  // of the picture's size [m]: what a radian counts beside the place
const NEAR_ENOUGH = 1e-3;  // of the picture's size [m], and [rad]: so near, a pose counts as taken
const LIMIT_ROUNDING = 1e-9;  // [rad or m]

/** The numbers x with A x = b; A is symmetric and positive. */
function solved(A, b) {
  const rows = A.map((row, i) => [...row, b[i]]);
  rows.forEach((row, i) => {
    for (const other of rows.slice(i + 1)) {
      const share = other[i] / row[i];
      for (let k = i; k < other.length; k += 1) other[k] -= share * row[k];
    }
  });
  const x = b.slice();
  for (let i = x.length - 1; i >= 0; i -= 1) {
    const known = rows[i].slice(i + 1, -1).reduce((sum, value, k) => sum + value * x[i + 1 + k], 0);
    x[i] = (rows[i][x.length] - known) / rows[i][i];
  }
  return x;
}

const originOf = (matrix) => new THREE.Vector3().setFromMatrixPosition(matrix);

/** What is missing from one pose to another: the way [m], and the turn about an axis [rad]. */
function missing(from, to) {
  const turn = new THREE.Matrix4().extractRotation(to).multiply(new THREE.Matrix4().extractRotation(from).transpose());
  const { x, y, z, w } = new THREE.Quaternion().setFromRotationMatrix(turn);
  const axis = new THREE.Vector3(x, y, z);
  const angle = 2 * Math.atan2(axis.length(), Math.abs(w));
  return { way: originOf(to).sub(originOf(from)), turn: axis.setLength(Math.sign(w || 1) * angle) };
}

/** What a joint moves of a tip: columns of the Jacobian, each of six numbers. */
function columnsOf(tip, frames, weight) {
  const columns = robot.joints.map(() => [0, 0, 0, 0, 0, 0]);
  const at = originOf(carried(tip, frames));
  for (const k of jointsOf(tip.joint)) {
    const axis = new THREE.Vector3(...robot.axis[k - 1]).transformDirection(frames[k]);
    const along = robot.prismatic[k - 1] ? axis : axis.clone().cross(at.clone().sub(originOf(frames[k])));
    const about = robot.prismatic[k - 1] ? new THREE.Vector3() : axis.multiplyScalar(weight);
    const moved = [...along.toArray(), ...about.toArray()];
    robot.gain[k - 1].forEach((gain, j) => moved.forEach((value, i) => { columns[j][i] += gain * value; }));
  }
  return columns;
}

/** The joint values near `from` whose tip comes nearest to a pose, and in words what keeps it from there; no words where nothing does. */
function nearestReach(tip, wanted, from) {
  const weight = TURN_WEIGHT * size;
  const { lower, upper } = planning;
  const gapAt = (q) => {
    const frames = jointFrames(q);
    const { way, turn } = missing(carried(tip, frames), wanted);
    const gap = [...way.toArray(), ...turn.clone().multiplyScalar(weight).toArray()];
    return { frames, way: way.length(), turn: turn.length(), gap, square: gap.reduce((sum, value) => sum + value * value, 0) };
  };
  const pullsAt = ({ frames, gap }) => {
    const columns = columnsOf(tip, frames, weight);
    return { columns, pulls: columns.map((column) => column.reduce((sum, value, i) => sum + value * gap[i], 0)) };
  };
  const heldBack = (q, pulls) => pulls.map((pull, j) => (pull < 0 ? q[j] <= lower[j] + LIMIT_ROUNDING : q[j] >= upper[j] - LIMIT_ROUNDING));

  let q = from.slice();
  let now = gapAt(q);
  let damping = 1e-3;
  for (let round = 0; round < NEAR_ROUNDS; round += 1) {
    const { columns, pulls } = pullsAt(now);
    const held = heldBack(q, pulls);
    const free = [...q.keys()].filter((j) => !held[j]);
    const added = (damping + 1e-9) * size * size;
    const square = free.map((a) => free.map((b) => columns[a].reduce((sum, value, i) => sum + value * columns[b][i], a === b ? added : 0)));
    const step = solved(square, free.map((j) => pulls[j]));
    const next = q.slice();
    free.forEach((j, n) => { next[j] = Math.min(Math.max(q[j] + step[n], lower[j]), upper[j]); });
    const then = gapAt(next);
    damping = then.square < now.square ? damping / 4 : 8 * damping;
    if (then.square < now.square) [q, now] = [next, then];
    if (damping > 1e6 || now.square < (1e-6 * size) ** 2) break;
  }
  return { q, out: now.way > NEAR_ENOUGH * size, text: whyNot(now, q, pullsAt(now).pulls, heldBack) };
}

/** What keeps a tip from a pose: the joint at its limit that would go on farthest. */
function whyNot({ way, turn }, q, pulls, heldBack) {
  if (way <= NEAR_ENOUGH * size && turn <= NEAR_ENOUGH) return "";
  const held = heldBack(q, pulls);
  const blocked = [...q.keys()].filter((j) => held[j]).sort((a, b) => Math.abs(pulls[b]) - Math.abs(pulls[a]))[0];
  const reason = blocked === undefined ? "the arm is stretched out" : `${robot.joints[blocked].name} at its limit`;
  if (way > NEAR_ENOUGH * size) return `out of reach by ${(1000 * way).toFixed(0)} mm: ${reason}`;
  return `turned by ${((180 * turn) / Math.PI).toFixed(0)} deg: ${blocked === undefined ? "its joints allow no other" : reason}`;
}
