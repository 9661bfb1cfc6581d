// A problem file in the page: what "Save problem" writes, dropped, chosen or typed. What does not fit is said in a line.
const LARGEST_FILE = 2e6;  // bytes
const MOVED_KEYS = ["name", "start", "goal", "scene"];

const refuse = (text) => { throw new Error(text); };
const isRow = (value, length) => Array.isArray(value) && value.length === length && value.every((x) => Number.isFinite(x));
const isGroup = (value) => value !== null && typeof value === "object" && !Array.isArray(value);

/** The same text for the same values, whatever the order of keys. */
function canonical(value) {
  const ordered = (_, each) => (isGroup(each) ? Object.fromEntries(Object.entries(each).sort()) : each);
  return JSON.stringify(value, ordered) ?? "";
}

/** Joint values of an end in a file, inside the limits. */
function endIn(problem, end) {
  const q = problem[end]?.joints;
  if (!isRow(q, planning.dof)) refuse(`${end} needs joints: a list of ${planning.dof} numbers [rad or m]`);
  const j = q.findIndex((value, k) => value < planning.lower[k] || value > planning.upper[k]);
  if (j >= 0) refuse(`${end}: ${robot.joints[j].name} is at ${withUnit(j, q[j])}, but goes from ${withUnit(j, planning.lower[j])} to ${withUnit(j, planning.upper[j])}`);
  return q;
}

function sizesIn(entry, shape) {
  const given = entry[shape];
  const sizes = { box: given, sphere: [given] }[shape] ?? [given?.radius, given?.length];
  const good = isRow(sizes, SIZE_NAMES[shape].length) && sizes.every((length) => length > 0 && length <= AWAY / 10);
  return good ? sizes : refuse(`${entry.name}: ${shape} needs ${SIZE_NAMES[shape].join(", ")}, each above 0 and at most ${AWAY / 10} m`);
}

function poseIn(entry) {
  const { xyz = [0, 0, 0], quat_xyzw: turn = [0, 0, 0, 1], ...others } = entry.pose ?? {};
  const good = isRow(xyz, 3) && largest(xyz) <= AWAY / 10 && isRow(turn, 4) && Math.abs(norm(turn) - 1) < 1e-3;
  if (!good || Object.keys(others).length) refuse(`${entry.name}: its pose needs xyz of at most ${AWAY / 10} m and quat_xyzw of length 1, nothing else`);
  const parts = [new THREE.Vector3(...xyz), new THREE.Quaternion(...turn).normalize(), new THREE.Vector3(1, 1, 1)];
  return new THREE.Matrix4().compose(...parts).transpose().elements.slice();
}

/** An obstacle of the page as a file has it. */
function obstacleIn(k, entry, listed) {
  const { name, shape, first } = planning.obstacles[k];
  if (entry === undefined) return { ...copyOf(state.obstacles[k]), shown: false };
  if (canonical(entry) === canonical(listed)) return { pose: first.pose.slice(), sizes: first.sizes.slice(), shown: true };
  const rest = ({ pose, [shape]: own, ...others }) => canonical(others);
  if (rest(entry) !== rest(listed ?? { name })) refuse(`${name}: here it is a ${shape}; its place, turn and sizes alone can change`);
  return { pose: poseIn(entry), sizes: sizesIn(entry, shape), shown: true };
}

function obstaclesIn(problem) {
  const [own, scene] = [planning.problem.scene ?? {}, problem.scene ?? {}];
  const [listed, given] = [own.obstacles ?? [], scene.obstacles ?? []];
  if (!Array.isArray(given) || !given.every((entry) => isGroup(entry) && typeof entry.name === "string")) refuse("scene: obstacles must be a list of groups of keys, each with a name");
  if (canonical({ ...own, obstacles: [] }) !== canonical({ ...scene, obstacles: [] })) refuse("scene: beside obstacles nothing can change here");
  const names = given.map(({ name }) => name);
  const twice = names.find((name, k) => names.indexOf(name) < k);
  if (twice !== undefined) refuse(`${twice}: the name is used twice`);
  const strange = given.find((entry) => numberOf(entry.name) < 0 && !listed.some((each) => canonical(each) === canonical(entry)));
  if (strange) refuse(`${strange.name}: this page cannot move or add it; rrtik show makes a page of another problem`);
  const gone = listed.find(({ name }) => numberOf(name) < 0 && !names.includes(name));
  if (gone) refuse(`${gone.name}: it stays in this page, but is not in the file`);
  const find = (entries, name) => entries.find((each) => each.name === name);
  return planning.obstacles.map(({ name }, k) => obstacleIn(k, find(given, name), find(listed, name)));
}

/** The state that a file describes. */
function stateIn(text) {
  let problem = null;
  try {
    problem = JSON.parse(text);
  } catch {
    refuse("not JSON, which is what Save problem writes and this page reads; rrtik plan reads every problem file");
  }
  if (!isGroup(problem)) refuse("no problem: a group of keys is wanted");
  const own = planning.problem;
  const other = Object.keys({ ...own, ...problem }).find((key) => !MOVED_KEYS.includes(key) && canonical(own[key]) !== canonical(problem[key]));
  if (other) refuse(`${other} is another than this page's; rrtik show makes a page of another problem`);
  return { ...copyOf(state), start: endIn(problem, "start"), goal: endIn(problem, "goal"), obstacles: obstaclesIn(problem) };
}

/** Take over what a file says, or say why not. */
function openText(name, text) {
  let wanted = null;
  try {
    wanted = stateIn(text);
  } catch (error) {
    return planRefusal(`${name}: ${error.message}`);
  }
  remember();
  state = wanted;
  state.obstacles.forEach((_, k) => applyObstacle(k));
  showState();
  return changed();
}

async function openFile(file) {
  if (!file) return;
  if (file.size > LARGEST_FILE) planRefusal(`${file.name}: larger than ${LARGEST_FILE / 1e6} MB, which no problem file of this page is`);
  else openText(file.name, await file.text());
}

function wireOpening() {
  const [button, chosen, typed] = ["plan-open", "plan-file", "plan-text"].map((id) => document.getElementById(id));
  button.addEventListener("click", () => chosen.click());
  chosen.addEventListener("change", async () => {
    await openFile(chosen.files[0]);
    chosen.value = "";  // so that the same file can be chosen again
  });
  typed.addEventListener("change", () => { if (typed.value.trim()) openText("typed problem", typed.value); });
  document.addEventListener("dragover", (event) => event.preventDefault());
  document.addEventListener("drop", (event) => {
    event.preventDefault();
    openFile(event.dataTransfer.files[0]);
  });
}
