// What a person moves: ghosts and obstacles by the mouse, sliders and numbers beside the picture; undo and saving.
const TURN_PER_PIXEL = 0.01;  // [rad], with the shift key
const GHOSTS_FIRST = 0.05;  // of the picture's size: so much nearer a ghost counts than it is
let selected = "goal";

// Moving things ----------------------------------------------------------------------------------------------------
function tipFrame(q) {
  return jointFrames(q)[robot.tip.joint].multiply(rowMajor(robot.tip.placement));
}

/** Move the tip of an end by a shift [m] and a turn about z [rad], through inverse kinematics. */
function moveEnd(end, shift, turn) {
  const frame = tipFrame(state[end]);
  const e = new THREE.Matrix4().makeRotationZ(turn).multiply(new THREE.Matrix4().extractRotation(frame)).elements;
  const at = new THREE.Vector3().setFromMatrixPosition(frame).add(shift);
  const pose = [e[0], e[4], e[8], e[1], e[5], e[9], e[2], e[6], e[10], at.x, at.y, at.z];
  const q = kernels.reach(pose, state[end]);
  if (q !== null) state[end] = q;
  return q !== null;
}

function moveObstacle(k, shift, turn) {
  const turned = new THREE.Matrix4().makeRotationZ(turn).multiply(rowMajor(state.obstacles[k].pose).setPosition(0, 0, 0));
  const old = state.obstacles[k].pose;
  turned.setPosition(old[3] + shift.x, old[7] + shift.y, old[11] + shift.z);
  state.obstacles[k].pose = turned.clone().transpose().elements.slice();
  applyObstacle(k);
}

const numberOf = (name) => planning.obstacles.findIndex((obstacle) => obstacle.name === name);

function moveSelected(shift, turn) {
  const moved = ENDS[selected] ? moveEnd(selected, shift, turn) : (moveObstacle(numberOf(selected), shift, turn), true);
  if (moved) {
    showSelected();
    changed();
  }
}

const ray = new THREE.Raycaster();
ray.params.Line.threshold = 0;  // edges are drawn as lines, and count as a metre thick by default
function pointerAt(event) {
  const box = pane.getBoundingClientRect();
  const place = { x: (2 * (event.clientX - box.left)) / box.width - 1, y: 1 - (2 * (event.clientY - box.top)) / box.height };
  viewer.camera.updateMatrixWorld();
  ray.setFromCamera(place, viewer.camera);
}

function thingsToDrag() {
  const ends = Object.keys(ENDS).map((end) => ({ name: end, object: node(ENDS[end]) }));
  const solids = planning.obstacles.map((obstacle, k) => ({ name: obstacle.name, object: node("obstacles", obstacle.node), shown: state.obstacles[k].shown }));
  return [...ends, ...solids].filter(({ object, shown }) => shown !== false && object.visible);
}

function hitThing() {
  const hits = thingsToDrag().flatMap(({ name, object }) => ray.intersectObject(object, true).slice(0, 1).map((hit) => ({ name, hit })));
  const away = ({ name, hit }) => hit.distance - (ENDS[name] ? GHOSTS_FIRST * size : 0);
  return hits.sort((a, b) => away(a) - away(b))[0];
}

let drag = null;
function startDrag(event) {
  if (event.button !== 0 || !event.isPrimary) return;
  pointerAt(event);
  const found = hitThing();
  if (!found) return;
  event.stopPropagation();
  event.preventDefault();
  remember();
  select(found.name);
  const away = viewer.camera.getWorldDirection(new THREE.Vector3());
  drag = { plane: new THREE.Plane().setFromNormalAndCoplanarPoint(away, found.hit.point), last: found.hit.point.clone(), x: event.clientX };
  pane.setPointerCapture(event.pointerId);
}

function goOnDragging(event) {
  if (drag === null) return;
  event.stopPropagation();
  if (event.shiftKey) {
    moveSelected(new THREE.Vector3(), (event.clientX - drag.x) * TURN_PER_PIXEL);
  } else {
    pointerAt(event);
    const point = ray.ray.intersectPlane(drag.plane, new THREE.Vector3());
    if (point === null) return;
    const way = point.clone().sub(drag.last);
    moveSelected(new THREE.Vector3(way.x, -way.z, story.planar ? 0 : way.y), 0);  // meshcat's picture has y up
    drag.last = point;
  }
  drag.x = event.clientX;
}

function endDrag(event) {
  if (drag === null) return;
  event.stopPropagation();
  drag = null;
}

// The controls -----------------------------------------------------------------------------------------------------
function select(name) {
  selected = name;
  document.getElementById("plan-selected").value = name;
  showSelected();
}

const fields = [];
/** Sliders of an end's joints, or numbers of an obstacle's place. */
function showSelected() {
  const table = document.getElementById("plan-fields");
  if (table.dataset.shows !== selected) {
    table.dataset.shows = selected;
    fields.length = 0;
    table.replaceChildren(...(ENDS[selected] ? jointFields() : placeFields()));
  }
  fields.forEach((show) => show());
}

function fieldRow(text, input, reading) {
  input.addEventListener("pointerdown", remember);
  input.addEventListener("keydown", (event) => { if (event.key.startsWith("Arrow")) remember(); });
  return make("tr", {}, make("td", { className: "name", textContent: text }), make("td", { className: "range" }, input), reading);
}

function jointFields() {
  const end = selected;
  return robot.joints.map((joint, j) => {
    const input = make("input", { type: "range", min: planning.lower[j], max: planning.upper[j], step: "any", ariaLabel: `${end}: ${joint.name}` });
    const reading = make("td", { className: "number" });
    input.addEventListener("input", () => { state[end][j] = Number(input.value); showSelected(); changed(); });
    fields.push(() => { input.value = state[end][j]; reading.textContent = withUnit(j, state[end][j]); });
    return fieldRow(joint.name, input, reading);
  });
}

function placeFields() {
  const k = numberOf(selected);
  const step = Number((0.01 * story.grid).toPrecision(1));
  return ["x", "y", "z"].map((axis, i) => {
    const input = make("input", { type: "number", step, ariaLabel: `${selected}: ${axis} in metres` });
    input.addEventListener("change", () => {
      const wanted = Number(input.value);
      if (input.value === "" || !Number.isFinite(wanted) || Math.abs(wanted) > AWAY / 10) {
        planStatus(`${selected}: ${axis} must be a number of metres, at most ${AWAY / 10}`, true);
        return;
      }
      remember();
      const shift = new THREE.Vector3().setComponent(i, wanted - state.obstacles[k].pose[4 * i + 3]);
      moveSelected(shift, 0);
    });
    fields.push(() => { input.value = state.obstacles[k].pose[4 * i + 3].toFixed(3); });
    return fieldRow(axis, input, make("td", { className: "number", textContent: "m" }));
  });
}

function fillSelection() {
  const names = [...Object.keys(ENDS), ...planning.obstacles.filter((_, k) => state.obstacles[k].shown).map(({ name }) => name)];
  document.getElementById("plan-selected").replaceChildren(...names.map((name) => make("option", { value: name, textContent: name })));
  select(names.includes(selected) ? selected : "goal");
}

function addBox() {
  const k = planning.obstacles.findIndex((obstacle, n) => obstacle.spare && !state.obstacles[n].shown);
  if (k < 0) return planStatus(`this page has room for ${count(planning.obstacles.filter(({ spare }) => spare).length, "more box")} only`, true);
  remember();
  const tip = tipPosition(state.goal.map((value, j) => 0.5 * (value + state.start[j])));
  const obstacle = planning.obstacles[k];
  state.obstacles[k] = { pose: [1, 0, 0, tip.x, 0, 1, 0, tip.y, 0, 0, 1, tip.z, 0, 0, 0, 1], shown: true };
  if (!node("obstacles", obstacle.node).children.length) {
    const solid = new THREE.BoxGeometry(...obstacle.half.map((half) => 2 * half));
    const group = new THREE.Group();
    group.add(new THREE.Mesh(solid, new THREE.MeshPhongMaterial({ color: story.colors.obstacle })));
    viewer.set_object([...ROOT, "obstacles", obstacle.node], group);
    outline(group, 0x7a5a1e);
  }
  applyObstacle(k);
  selected = obstacle.name;
  fillSelection();
  return changed();
}

function removeSelected() {
  if (ENDS[selected]) return planStatus("start and goal stay; select an obstacle to remove it", true);
  remember();
  const k = numberOf(selected);
  state.obstacles[k].shown = false;
  applyObstacle(k);
  fillSelection();
  return changed();
}

function download(name, text) {
  const url = URL.createObjectURL(new Blob([text], { type: "application/json" }));
  make("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 1e4);
}

function pathText() {
  const rows = story.waypoints;
  return JSON.stringify({ ...planning.path, length: lengthOf(rows), transitions: rows.length - 1, waypoints: rows }, null, 1);
}

/** The problem as it is now; JSON is YAML too. */
function problemText() {
  const problem = copyOf(planning.problem);
  const scene = problem.scene ?? {};
  const kept = (scene.obstacles ?? []).filter(({ name }) => numberOf(name) < 0 || state.obstacles[numberOf(name)].shown);
  const added = planning.obstacles.filter(({ spare }, k) => spare && state.obstacles[k].shown);
  const obstacles = [...kept, ...added.map(({ name, half }) => ({ name, box: half.map((h) => 2 * h) }))];
  for (const obstacle of obstacles) {
    const k = numberOf(obstacle.name);
    if (k < 0 || (!planning.obstacles[k].spare && state.obstacles[k].pose.every((value, n) => value === planning.obstacles[k].first[n]))) continue;
    const turn = new THREE.Quaternion().setFromRotationMatrix(rowMajor(state.obstacles[k].pose));
    obstacle.pose = { xyz: column(state.obstacles[k].pose, 3), quat_xyzw: turn.toArray() };
  }
  if (obstacles.length) problem.scene = { ...scene, obstacles };
  Object.assign(problem, { start: { joints: state.start }, goal: { joints: state.goal } });
  return JSON.stringify(problem, null, 1);
}

function wireControls() {
  const on = (id, event, action) => document.getElementById(id).addEventListener(event, action);
  on("plan-selected", "change", (event) => select(event.target.value));
  on("plan-seed", "change", (event) => {
    const seed = Number(event.target.value);
    if (!Number.isInteger(seed) || seed < 0) return planStatus("the seed must be a whole number, 0 or more", true);
    state.seed = seed;
    return changed();
  });
  on("plan-shorten", "change", changed);
  on("plan-undo", "click", undo);
  on("plan-add", "click", addBox);
  on("plan-remove", "click", removeSelected);
  on("plan-save-path", "click", () => {
    if (story.moves.length === 0) return planStatus("there is no path to save", true);
    return download("path.json", pathText());
  });
  on("plan-save-problem", "click", () => download("problem.yaml", problemText()));
  document.getElementById("plan-save-problem").hidden = planning.problem === null;
  pane.addEventListener("pointerdown", startDrag, true);
  pane.addEventListener("pointermove", goOnDragging, true);
  pane.addEventListener("pointerup", endDrag, true);
  pane.addEventListener("pointercancel", endDrag, true);
}

async function startPlanning() {
  const section = document.getElementById("plan-section");
  section.hidden = false;
  if (!hasKernels()) {
    section.querySelectorAll(".control").forEach((element) => { element.hidden = true; });
    planStatus("this browser cannot plan in the page: it lacks WebAssembly with SIMD, or DecompressionStream", true);
    return;
  }
  try {
    kernels = await Kernels.load(planning);
  } catch (error) {
    section.querySelectorAll(".control").forEach((element) => { element.hidden = true; });
    planStatus(`the page cannot plan: ${error.message}`, true);
    return;
  }
  for (const obstacle of planning.obstacles) obstacle.first = obstacle.pose.slice();
  state = { start: planning.start.slice(), goal: planning.goal.slice(), seed: 1, obstacles: planning.obstacles.map(({ pose, spare }) => ({ pose: pose.slice(), shown: !spare })) };
  fillSelection();
  wireControls();
  planStatus("drag a ghost or an obstacle: the arm finds a new path");
  document.documentElement.dataset.plans = "yes";
}

if (planning) startPlanning();
