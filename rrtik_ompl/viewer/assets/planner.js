// Planning in the page: from its state (start, goal, obstacles) to a path, which is drawn and played at once.
const planning = story.plan;
const LIVE_MILLISECONDS = 8;  // of shortening in one frame
const AWAY = 1e3;  // [m] where removed obstacles stand
const CLEARANCE_SAMPLES = 200;
const UNDO_STEPS = 200;
const ENDS = new Map([["start", "start ghost"], ["goal", "goal ghost"]]);
// What can be selected: an end by its name, an obstacle by its number, as one may be called "goal" too.
const isEnd = (thing) => ENDS.has(thing);
const nameOf = (thing) => (isEnd(thing) ? thing : planning.obstacles[thing].name);
let kernels = null;
let state = null;  // { start, goal, planner, seed, obstacles: [{ pose, shown, sizes }] }
let shortening = 0;  // number of the path that is being made shorter
const past = [];

const copyOf = (value) => JSON.parse(JSON.stringify(value));
const planStatus = (text, bad = false) => {
  const line = document.getElementById("plan-state");
  line.textContent = text;
  line.classList.toggle("bad", bad);
  trouble = bad ? text : "";
  sayBesideHand();
};
/** Say why an input was not taken; it stands until the next change, as a path may be in the making that says its own. */
const planRefusal = (text, { mild = false } = {}) => {
  const line = document.getElementById("plan-refusal");
  line.textContent = text;
  line.hidden = !text;
  line.classList.toggle("mild", mild);
};

// The picture ------------------------------------------------------------------------------------------------------
function moveGhost(end, q, free) {
  if (story[`${end}_ghost`]) story[`${end}_ghost`] = q;
  const name = ENDS.get(end);
  const color = !free ? "#c2185b" : farEnd === end ? OUT_OF_REACH : story.colors[end];
  if (!viewer.scene_tree.find([...ROOT, name]).object.children.length) addGhost(name, color, q);
  for (const copy of node(name).children[0].children) {
    setPosture(copy, q);
    copy.traverse((item) => { if (item.isMesh && item.material.emissive) tintGlass(item.material, color); });
  }
}

/** Draw an end where it is; true if it is free. */
function showFree(end) {
  const free = kernels.free(state[end]);
  moveGhost(end, state[end], free);
  return free;
}

/** Draw an obstacle where it is; anew if the page has added it or made it another size. */
function moveDrawing(k) {
  const { shown, sizes } = state.obstacles[k];
  const pose = poseNow(k);
  const obstacle = planning.obstacles[k];
  const drawnSizes = obstacle.drawnSizes ?? (obstacle.spare ? [] : obstacle.first.sizes);
  if (shown && !sameNumbers(sizes, drawnSizes)) drawShape(obstacle, sizes);
  const group = node("obstacles", obstacle.node);
  obstacle.drawn ??= obstacle.spare ? new THREE.Matrix4() : rowMajor(obstacle.first.pose).invert().multiply(group.matrix);
  new THREE.Matrix4().multiplyMatrices(rowMajor(pose), obstacle.drawn).decompose(group.position, group.quaternion, new THREE.Vector3());
  group.updateMatrix();
  group.visible = shown;
}

/** The colour of an obstacle; of one that the page has added that of the first. */
function drawnColor({ name }) {
  return story.obstacles.find((each) => each.name === name)?.color ?? story.colors.obstacle;
}

function drawShape(obstacle, sizes) {
  const group = new THREE.Group();
  group.add(new THREE.Mesh(shapeGeometry(obstacle.shape, sizes), new THREE.MeshPhongMaterial({ color: drawnColor(obstacle) })));
  viewer.delete_path([...ROOT, "obstacles", obstacle.node]);
  viewer.set_object([...ROOT, "obstacles", obstacle.node], group);
  outline(group);
  applyEyes("obstacles");
  Object.assign(obstacle, { drawnSizes: sizes.slice(), drawn: new THREE.Matrix4() });
}

function pathTimes(rows) {
  const times = [0];
  for (let k = 1; k < rows.length; k += 1) {
    times.push(times[k - 1] + Math.max(...rows[k].map((value, j) => Math.abs(value - rows[k - 1][j]) / planning.speeds[j])));
  }
  const whole = times[times.length - 1];
  const scale = whole > 0 ? Math.min(Math.max(whole, planning.seconds[0]), planning.seconds[1]) / whole : 1;
  return times.map((time) => time * scale);
}

/** Draw the way of the tips; moves that are not proven free have another colour. */
function drawTrail(rows, unproven = []) {
  const trail = new THREE.Group();
  for (let k = 1; k < rows.length; k += 1) {
    const piece = new THREE.Group();
    piece.name = `piece ${k - 1}`;
    const turn = rows[k].reduce((sum, value, j) => sum + Math.abs(value - rows[k - 1][j]), 0);
    const steps = Math.min(Math.max(Math.ceil(turn / 0.1), 1), 60);
    const frames = Array.from({ length: steps + 1 }, (_, s) => jointFrames(rows[k - 1].map((a, j) => a + ((rows[k][j] - a) * s) / steps)));
    for (const tip of robot.trails) {
      const points = frames.map((each) => new THREE.Vector3().setFromMatrixPosition(carried(tip, each)).toArray());
      const apart = points.filter((point, s) => s === 0 || Math.hypot(...point.map((x, i) => x - points[s - 1][i])) > 1e-6);
      if (apart.length > 1) piece.add(lineMesh(apart, unproven.includes(k - 1) ? story.colors.unproven : story.colors.trail, 0.0025 * size));
    }
    trail.add(piece);
  }
  viewer.delete_path([...ROOT, "trail"]);
  viewer.delete_path([...ROOT, "beads"]);
  viewer.set_object([...ROOT, "trail"], trail);
  applyEyes("trails");
}

/** The heading says what is shown now; one that was given stays. */
function sayTitle(text) {
  if (!story.name) return;
  document.title = `${story.name}: ${text}`;
  document.getElementById("title").textContent = document.title;
}

/** A path for comparison is one of the first problem: with another path it goes. */
function dropBefore() {
  if (!story.before) return;
  story.before = "";
  viewer.delete_path([...ROOT, "before"]);
  buildTree();
}

/** Play other rows from now on; an empty list for none. */
function replacePath(rows) {
  story.waypoints = rows.length ? rows : [state.start];
  story.contacts = [];  // what the page plans is free
  story.moves = rows.slice(1).map((to, k) => ({ from: rows[k], to, piece: k, joints: to.flatMap((value, j) => (value === rows[k][j] ? [] : [j])) }));
  story.times = rows.length ? pathTimes(rows) : [];
  showPath();
}

let pathIsOfState = true;  // whether the path that is shown is one of the state, or of what it was before
let given = null;  // the path with which the page began: Python has judged it
const OWN_PROOF = { proven: false, text: "free at each step of its check, not proven between" };  // of a path that the page has found

/** Show the path of the story, and of that with which the page began what Python says of it. */
function showPath() {
  const judged = story.waypoints === given.waypoints;
  drawTrail(story.moves.length ? story.waypoints : [], judged ? story.proof?.unproven : []);
  sayTitle(story.moves.length ? `path of ${count(story.moves.length, "move")}` : "no path");
  if (!judged) {
    dropBefore();
  }
  showSearchOf({ first: judged, sameObstacles: planning.obstacles.every((_, k) => isAtFirst(k)) });
  document.getElementById("clearance-section").hidden = !(judged && story.clearance);
  sayProof(judged ? story.proof : story.moves.length ? OWN_PROOF : null);
  showClearance = judged ? given.showClearance : () => {};
  pathIsOfState = true;
  newPath();
  askOpinion();
}

// The state --------------------------------------------------------------------------------------------------------
/** Whether an obstacle is as in the beginning: one that the page can add is not there. */
function isAtFirst(k) {
  const { spare, first } = planning.obstacles[k];
  const { pose, sizes, shown } = state.obstacles[k];
  return shown ? !spare && sameNumbers(pose, first.pose) && sameNumbers(sizes, first.sizes) : Boolean(spare);
}

obstaclesNow = () => {
  const removed = planning.obstacles.filter(({ spare }, k) => !spare && !state.obstacles[k].shown).map(({ name }) => name);
  const added = planning.obstacles.filter(({ spare }, k) => spare && state.obstacles[k].shown);
  return [...story.obstacles.filter(({ name }) => !removed.includes(name)), ...added.map((each) => ({ ...each, color: drawnColor(each) }))];
};
goalNow = () => (sameNumbers(state.goal, planning.goal) ? story.goal : "joint values");

let listed = "";  // names of the obstacles in the tree
/** Heading, tree, goal and table of solutions say what the problem is now. */
function showProblem() {
  const obstacles = obstaclesNow();
  const names = obstacles.map(({ name }) => name).join("\n");
  if (listed && names !== listed) buildTree();
  listed = names;
  saySubtitle(obstacles.length, goalNow());
  applyEyes("goal");
  if (story.ghosts.length > 1) {
    const k = markSolution(state.goal);
    document.getElementById("plan-goal").value = k < 0 ? "" : k;
  }
}

/** Keep the state and the path that is shown for it, if there is one by now. */
function remember() {
  const { waypoints, moves, times, contacts } = story;
  const { textContent: text, className } = document.getElementById("plan-state");
  past.push({ state: copyOf(state), shown: pathIsOfState ? { story: { waypoints, moves, times, contacts }, text, bad: className === "bad" } : null });
  if (past.length > UNDO_STEPS) past.shift();
  showUndo();
}

const showUndo = () => { document.getElementById("plan-undo").disabled = past.length === 0; };

/** The state before the last change, with the same path. */
function undo() {
  if (past.length === 0) return;
  if (clock.running) {
    planRefusal("the run goes on: stop it, then undo");
    return;
  }
  const { state: before, shown } = past.pop();
  showUndo();
  state = before;
  state.obstacles.forEach((_, k) => applyObstacle(k));
  showState();
  if (shown === null) {
    changed();
    return;
  }
  shortening += 1;
  planRefusal("");
  for (const end of ENDS.keys()) showFree(end);
  Object.assign(story, shown.story);
  showPath();
  planStatus(shown.text, shown.bad);
}

/** Where the kernels find an obstacle, in the size that it has now. */
const putInTables = (k, pose) => placeObstacle(kernels, resized(planning.obstacles[k], state.obstacles[k].sizes), pose);

/** Whether a person can take hold of an obstacle. */
const isMovable = (k) => state.obstacles[k].shown && !staysOnCourse(k);

function applyObstacle(k) {
  const kept = state.obstacles[k];
  const pose = poseNow(k);
  putInTables(k, kept.shown ? pose : pose.map((value, n) => (n === 11 ? value - AWAY : value)));
  moveDrawing(k);
}

let again = null;  // whether something has changed since the path of this frame; null where none was looked for in it
/** Find a path at once, so that the next picture has it; of several changes between two pictures the first and the last count. */
function changed() {
  planRefusal("");
  if (clock.running) return;
  if (again !== null) {
    again = true;
    return;
  }
  again = false;
  requestAnimationFrame(() => {
    const missed = again;
    again = null;
    if (missed && !clock.running) plan();
  });
  plan();
}

function plan() {
  shortening += 1;
  pathIsOfState = false;
  showProblem();
  const begin = performance.now();
  const blocked = [...ENDS.keys()].filter((end) => !showFree(end));
  viewer.set_dirty();
  if (blocked.length) {
    planStatus(blocked.map((end) => `${end}: ${kernels.blame(state[end])}`).join("; "), true);
    replacePath([]);
    return;
  }
  const { search, shorten } = PLANNERS[state.planner];
  inFrames(search(state.seed), shortening, {
    each: () => planStatus("searching ..."),
    end: (found) => {
      if (!found) {
        planStatus(`no path found in ${planning.samples.toLocaleString("en")} samples; another seed may find one`, true);
        replacePath([]);
        return;
      }
      const searched = performance.now() - begin;
      if (!document.getElementById("plan-shorten").checked) finish(found, searched);
      else inFrames(shorten(found), shortening, { each: (rows) => finish(rows, searched), end: () => {} });
    },
  });
}

// Searches, and how their paths are made shorter.
const PLANNERS = {
  RRTConnect: {
    label: "RRT-Connect",
    search: (seed) => kernels.searchPath(state.start, state.goal, seed),
    shorten: (rows) => kernels.shortened(rows, state.seed),
  },
  BiCRDT: {
    label: "one joint at a time",
    search: (seed) => searchMoves(kernels, state.start, state.goal, seed),
    shorten: (rows) => bestMoves(kernels, rows, state.seed),
  },
};

/** Let work go on for some milliseconds a frame, until it is done or another path is wanted: the page never stands still. */
function inFrames(work, number, { each, end }, last = undefined) {
  if (number !== shortening) return;
  const until = performance.now() + LIVE_MILLISECONDS;
  let step = work.next();
  let given = step.done ? last : step.value;
  while (!step.done && performance.now() < until) {
    step = work.next();
    if (!step.done) given = step.value;
  }
  if (given !== last || !step.done) each(given);
  if (step.done) end(step.value);
  else requestAnimationFrame(() => inFrames(work, number, { each, end }, given));
}

function finish(rows, searched) {
  replacePath(rows);
  let least = Infinity;
  for (let s = 0; s <= CLEARANCE_SAMPLES; s += 1) {
    least = Math.min(least, kernels.nearest(postureAt((story.times[story.times.length - 1] * s) / CLEARANCE_SAMPLES)).metres);
  }
  const when = story.moving ? " at time 0" : "";
  const clear = least > 0 ? `, at least ${millimetres(least)} clear${when} at each of ${CLEARANCE_SAMPLES + 1} places` : `, free but close${when}: nearer than the covers can measure`;
  const told = least === Infinity ? "" : clear;  // the distance of the covers is a lower bound
  planStatus(`${count(rows.length - 1, "move")}, length ${lengthOf(rows).toFixed(2)}${told}; found in ${searched.toFixed(1)} ms`);
}
