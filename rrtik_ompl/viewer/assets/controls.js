// What a person sets beside the picture: what is selected, its numbers, planner, seed, undo.
// The controls -----------------------------------------------------------------------------------------------------
function select(thing) {
  selected = thing;
  document.getElementById("plan-selected").value = String(thing);
  document.getElementById("plan-lock-label").hidden = isEnd(thing) || !isMovable(thing);
  document.getElementById("plan-lock").checked = isLocked(thing);
  outlineThing(isLocked(thing) ? thing : null);
  placeHandles();
  dropLabels("selected");
  if (!isEnd(thing)) addLabel(`${nameOf(thing)}${isLocked(thing) ? " (locked)" : ""}`, "selected", originOf(poseOf(thing)), namePlace);
  showSelected();
  viewer.set_dirty();
}

/** Lock what is selected, or let the pointer take hold of it. */
function lockSelected(locked) {
  planning.obstacles[selected].locked = locked;
  fillSelection();
}

const fields = [];
/** Sliders of an end's joints, or numbers of an obstacle's place. */
function showSelected() {
  const table = document.getElementById("plan-fields");
  if (table.dataset.shows !== String(selected)) {
    table.dataset.shows = String(selected);
    fields.length = 0;
    table.replaceChildren(...(isEnd(selected) ? jointFields() : placeFields()));
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

/** A number that a person types; `set` gets it, `told` says what it is now. */
function numberRow(text, unit, step, told, set, fault) {
  const input = make("input", { type: "number", step, ariaLabel: `${nameOf(selected)}: ${text} in ${unit}` });
  input.addEventListener("change", () => {
    const wanted = Number(input.value);
    const bad = input.value === "" || !Number.isFinite(wanted) ? "must be a number" : fault(wanted);
    if (bad) {
      showSelected();
      planRefusal(`${nameOf(selected)}: ${text} ${bad}`);
      return;
    }
    remember();
    set(wanted);
    showSelected();
    changed();
  });
  fields.push(() => { input.value = Number(told().toFixed(4)); });
  return fieldRow(text, input, make("td", { className: "number", textContent: unit }));
}

/** Where an obstacle is, how it is turned, how large it is. */
function placeFields() {
  const k = selected;
  const step = Number((0.01 * story.grid).toPrecision(1));
  const now = () => state.obstacles[k];
  const degrees = (radians) => (180 * radians) / Math.PI;
  const angles = () => new THREE.Euler().setFromRotationMatrix(rowMajor(now().pose), "ZYX");
  const far = (wanted) => (Math.abs(wanted) > AWAY / 10 ? `must be at most ${AWAY / 10} m` : "");
  const places = ["x", "y", "z"].map((axis, i) => numberRow(axis, "m", step, () => now().pose[4 * i + 3], (wanted) => {
    now().pose[4 * i + 3] = wanted;
    applyObstacle(k);
  }, far));
  const turns = [["roll", "x"], ["pitch", "y"], ["yaw", "z"]].map(([name, axis]) => numberRow(name, "deg", 5, () => degrees(angles()[axis]), (wanted) => {
    const turned = angles();
    turned[axis] = (wanted * Math.PI) / 180;
    const matrix = new THREE.Matrix4().makeRotationFromEuler(turned).setPosition(...column(now().pose, 3));
    now().pose = matrix.transpose().elements.slice();
    applyObstacle(k);
  }, () => ""));
  const small = (wanted) => (wanted > 0 && wanted <= AWAY / 10 ? "" : `must be above 0 and at most ${AWAY / 10} m`);
  const sizes = SIZE_NAMES[planning.obstacles[k].shape].map((name, i) => numberRow(name, "m", step, () => now().sizes[i], (wanted) => {
    now().sizes[i] = wanted;
    applyObstacle(k);
  }, small));
  return [...places, ...turns, ...sizes];
}

/** The controls as the state says. */
function showState() {
  showProblem();
  document.getElementById("plan-planner").value = state.planner;
  document.getElementById("plan-seed").value = state.seed;
  fillSelection();
}

function fillSelection() {
  const things = [...ENDS.keys(), ...planning.obstacles.keys()].filter((thing) => isEnd(thing) || isMovable(thing));
  document.getElementById("plan-selected").replaceChildren(...things.map((thing) => make("option", { value: String(thing), textContent: `${nameOf(thing)}${isLocked(thing) ? " (locked)" : ""}` })));
  select(things.includes(selected) ? selected : "goal");
}

const PLACES_AROUND = 8;  // that are tried for a new obstacle, at each of so many distances
const FARTHER = 0.06;  // of the picture's size, from one distance to the next

/** A new obstacle stands beside the middle of the way, where both ends stay free if there is such a place. */
function putWhereEndsStayFree(k) {
  const sizes = planning.obstacles[k].first.sizes.slice();
  const middle = tipPosition(state.goal.map((value, j) => 0.5 * (value + state.start[j])));
  const put = ({ x, y, z }) => {
    state.obstacles[k] = { pose: [1, 0, 0, x, 0, 1, 0, y, 0, 0, 1, z, 0, 0, 0, 1], shown: true, sizes };
    applyObstacle(k);
    return [...ENDS.keys()].every((end) => kernels.free(state[end]));
  };
  for (let n = 0; n < PLACES_AROUND * PLACES_AROUND; n += 1) {
    const angle = (2 * Math.PI * n) / PLACES_AROUND;
    const away = FARTHER * size * Math.floor(n / PLACES_AROUND);
    if (put(new THREE.Vector3(Math.cos(angle), Math.sin(angle), 0).multiplyScalar(away).add(middle))) return;
  }
  put(middle);
}

function addShape(shape) {
  const k = planning.obstacles.findIndex((obstacle, n) => obstacle.spare && obstacle.shape === shape && !state.obstacles[n].shown);
  if (k < 0) return planRefusal(`this page has no room for another ${shape}`);
  remember();
  putWhereEndsStayFree(k);
  selected = k;
  fillSelection();
  return changed();
}

function removeSelected() {
  if (isEnd(selected)) return planRefusal("start and goal stay; select an obstacle to remove it");
  remember();
  const k = selected;
  state.obstacles[k].shown = false;
  applyObstacle(k);
  fillSelection();
  return changed();
}

/** The goal is one of several solutions of inverse kinematics: a list to choose from. */
function wireGoals() {
  const list = document.getElementById("plan-goal");
  document.getElementById("plan-goals").hidden = story.ghosts.length < 2;
  list.append(...story.ghosts.map(({ name }, k) => make("option", { value: k, textContent: name })));
  list.addEventListener("change", () => {
    remember();
    state.goal = story.ghosts[Number(list.value)].q.map((value, j) => Math.min(Math.max(value, planning.lower[j]), planning.upper[j]));
    showSelected();
    changed();
  });
}

function wireControls() {
  const on = (id, event, action) => document.getElementById(id).addEventListener(event, action);
  on("plan-selected", "change", (event) => select(ENDS.has(event.target.value) ? event.target.value : Number(event.target.value)));
  on("plan-planner", "change", (event) => {
    remember();
    state.planner = event.target.value;
    changed();
  });
  on("plan-seed", "change", (event) => {
    const seed = Number(event.target.value);
    if (event.target.value === "" || !Number.isSafeInteger(seed) || seed < 0) {
      showState();
      return planRefusal("the seed must be a whole number, 0 or more");
    }
    remember();
    state.seed = seed;
    return changed();
  });
  on("plan-lock", "change", (event) => lockSelected(event.target.checked));
  on("plan-shorten", "change", changed);
  on("plan-undo", "click", undo);
  on("plan-add", "change", (event) => {
    addShape(event.target.value);
    event.target.value = "";
  });
  on("plan-remove", "click", removeSelected);
  on("plan-save-path", "click", () => {
    if (story.moves.length === 0) return planRefusal("there is no path to save");
    return download("path.json", pathText());
  });
  on("plan-save-problem", "click", () => download("problem.yaml", problemText()));
  for (const id of ["plan-save-problem", "plan-open", "plan-typing"]) document.getElementById(id).hidden = planning.problem === null;
  if (planning.problem !== null) wireOpening();
  wireGoals();
  wireRunning();
  pane.addEventListener("pointerdown", startDrag, true);
  pane.addEventListener("pointermove", goOnDragging, true);
  pane.addEventListener("pointerup", endDrag, true);
  pane.addEventListener("pointercancel", endDrag, true);
  pane.addEventListener("pointerleave", leavePane, true);
  addEventListener("keydown", pressKey);
  buildHandles();
  const render = viewer.render;
  viewer.render = () => { placeHandles(); render(); };
}

/** Escape gives up a drag, Delete removes what is selected, Ctrl+Z undoes; where a person types they are left to that. */
function pressKey(event) {
  if (event.target.matches?.("textarea, input:not([type=range], [type=checkbox])")) return;
  const undoes = event.key.toLowerCase() === "z" && (event.ctrlKey || event.metaKey) && !event.shiftKey;
  if (event.key === "Escape") giveUpDrag();
  else if (drag !== null) return;
  else if (undoes) undo();
  else if (event.key === "Delete") removeSelected();
  else return;
  event.preventDefault();
}

function startPlanning() {
  const section = document.getElementById("plan-section");
  section.hidden = false;
  document.getElementById("plan-keys").hidden = loading.kernels === null;
  kernels = loading.kernels;
  if (kernels === null) {
    section.querySelectorAll(".control").forEach((element) => { element.hidden = true; });
    planStatus(loading.fault, true);
    return;
  }
  for (const obstacle of planning.obstacles) obstacle.first = { pose: obstacle.pose.slice(), sizes: obstacle.sizes.slice() };
  state = { start: planning.start.slice(), goal: planning.goal.slice(), planner: planning.planner, seed: 1, obstacles: planning.obstacles.map(({ pose, sizes, spare }) => ({ pose: pose.slice(), shown: !spare, sizes: sizes.slice() })) };
  const spares = [...new Set(planning.obstacles.filter(({ spare }) => spare).map(({ shape }) => shape))];
  document.getElementById("plan-add").append(...spares.map((value) => make("option", { value, textContent: value })));
  const planners = Object.entries(PLANNERS).map(([value, { label }]) => make("option", { value, textContent: label }));
  document.getElementById("plan-planner").append(...planners);
  given = { waypoints: story.waypoints, showClearance };
  showState();
  showUndo();
  wireControls();
  showProblem();
  planStatus("drag the goal (green) by its handles, or click something else and drag that: the arm finds a new path");
  if (planning.asks && !story.moves.length) changed();
  else askOpinion();
  document.documentElement.dataset.plans = "yes";
}

if (planning) startPlanning();
