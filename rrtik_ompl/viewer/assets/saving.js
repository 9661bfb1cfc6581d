// What a person takes home: the path and the problem as they are now, as files of the commands.
const download = (name, text) => keepFile(name, new Blob([text], { type: "application/json" }));

function pathText() {
  const rows = story.waypoints;
  return JSON.stringify({ ...planning.path, length: lengthOf(rows), transitions: rows.length - 1, waypoints: rows }, null, 1);
}

/** An obstacle's entry in a problem file, as it is now. */
function obstacleEntry(k, entry) {
  const { name, shape, first } = planning.obstacles[k];
  const { pose, sizes } = state.obstacles[k];
  const now = { name, ...entry };
  if (!entry || !sameNumbers(sizes, first.sizes)) Object.assign(now, shapeEntry(shape, sizes));
  if (!entry || !sameNumbers(pose, first.pose)) {
    const turn = new THREE.Quaternion().setFromRotationMatrix(rowMajor(pose));
    now.pose = { xyz: column(pose, 3), quat_xyzw: turn.toArray() };
  }
  return now;
}

/** The problem as it is now; JSON is YAML too. */
function problemText() {
  const problem = copyOf(planning.problem);
  const scene = problem.scene ?? {};
  const listed = scene.obstacles ?? [];
  const fixed = listed.filter(({ name }) => numberOf(name) < 0);
  const shown = planning.obstacles.flatMap(({ name }, k) => (state.obstacles[k].shown ? [obstacleEntry(k, listed.find((each) => each.name === name))] : []));
  const rank = ({ name }) => { const place = listed.findIndex((each) => each.name === name); return place < 0 ? listed.length : place; };
  const obstacles = [...fixed, ...shown].sort((a, b) => rank(a) - rank(b));
  if (obstacles.length || listed.length) problem.scene = { ...scene, obstacles };
  Object.assign(problem, { start: { joints: state.start }, goal: { joints: state.goal } });
  return JSON.stringify(problem, null, 1);
}
