// Forward kinematics of the arm, and its posture at any time of the path.
const THREE = MeshCat.THREE;
const robot = story.robot;

/** Pose in the world of every joint frame, the world itself first, at configuration q [rad or m]. */
function jointFrames(q) {
  const frames = [new THREE.Matrix4()];
  robot.parent.forEach((parent, k) => {
    const value = robot.gain[k].reduce((sum, gain, j) => sum + gain * q[j], robot.offset[k]);
    const axis = new THREE.Vector3(...robot.axis[k]);
    const motion = new THREE.Matrix4();
    if (robot.prismatic[k]) motion.setPosition(axis.multiplyScalar(value));
    else motion.makeRotationAxis(axis, value);
    frames.push(frames[parent + 1].clone().multiply(rowMajor(robot.placement[k])).multiply(motion));
  });
  return frames;
}

/** Pose in the world of a tip that is carried by one of the joint frames. */
function carried(tip, frames) {
  return frames[tip.joint].clone().multiply(rowMajor(tip.placement));
}

/** Position of the tip in the world [m]. */
function tipPosition(q) {
  return new THREE.Vector3().setFromMatrixPosition(carried(robot.tip, jointFrames(q)));
}

function rowMajor(numbers) {
  return new THREE.Matrix4().set(...numbers);
}

/** Number of the move that is being made at a time: at a waypoint the one that begins there. */
function moveAt(time) {
  let k = 0;
  while (k < story.moves.length - 1 && story.times[k + 1] <= time + 1e-9) k += 1;
  return k;
}

/** Configuration at a time: joints move in straight lines between waypoints. */
function postureAt(time) {
  if (story.moves.length === 0) return story.waypoints[0].slice();
  const k = moveAt(time);
  const seconds = story.times[k + 1] - story.times[k];
  const share = seconds > 0 ? Math.min(Math.max((time - story.times[k]) / seconds, 0), 1) : 1;
  return story.waypoints[k].map((a, j) => a + (story.waypoints[k + 1][j] - a) * share);
}
