// What one can see, as a tree: each thing has a row with an eye; that of a group hides all that is in it.
const GROUPS = {  // in this order; films hide them by these names
  robot: "Robot", ghosts: "Ghosts", trails: "Trails", search: "Search", goal: "Goal", obstacles: "Obstacles", courses: "Courses", margins: "Margins", contacts: "In collision", marks: "Further bodies",
  labels: "Names", frames: "Frames", grid: "Ground",
};
const UNFOLDED = ["ghosts", "obstacles", "trails", "search", "contacts", "marks"];
const FEW_COURSES = 3;  // more are a heap, and hidden at first
const LONG_LIST = 12;  // groups with more rows are folded at first
const things = [];
let obstaclesNow = () => story.obstacles;  // pages that plan add some, and remove others
let goalNow = () => story.goal;  // in words; what is dragged has another one

/** A row of the tree; `show` is called with whether the thing is to be seen. */
function addThing(group, text, show, { color = null, opacity = 1, on = true } = {}) {
  things.push({ group, text, show, color, opacity, on });
}

const groupsOn = Object.fromEntries(Object.keys(GROUPS).map((name) => [name, true]));
const isSeen = ({ group, on }) => on && groupsOn[group];

/** Show what has its eye open, also of what has been drawn anew. */
function applyEyes(group = null) {
  for (const thing of things) if (group === null || thing.group === group) thing.show(isSeen(thing));
  viewer.set_dirty();
}

/** Close the eye of a group or of a thing by its name. */
function hideThing(name) {
  const found = things.filter(({ text }) => text === name);
  if (name in groupsOn) groupsOn[name] = false;
  else if (found.length) found.forEach((thing) => { thing.on = false; });
  else throw new Error(`nothing here is called '${name}'; what can be hidden: ${Object.keys(GROUPS).join(", ")}, caption, or an obstacle by its name`);
  applyEyes();
}

/** Objects on another layer are neither drawn nor found by the pointer, and cast no shadow. */
function setSeen(path, on) {
  node(...path).traverse((item) => item.layers.set(on ? 0 : 1));
}

const toggles = (...paths) => (on) => paths.forEach((path) => setVisible([path], on));

function seeThrough(on) {
  for (const group of node("obstacles").children) {
    group.traverse((item) => {
      if (!item.isMesh) return;
      item.userData.opacity ??= item.material.opacity;
      const opacity = on ? Math.min(0.3, item.userData.opacity) : item.userData.opacity;
      Object.assign(item.material, { opacity, transparent: opacity < 1, depthWrite: opacity === 1 });
    });
  }
  viewer.set_dirty();
}

/** Margins: those of polygons, meshes and half-spaces are not drawn, which the text says. */
function addMargins() {
  const kept = story.obstacles.filter(({ margin }) => margin > 0);
  if (kept.length === 0) return;
  const sizes = [Math.min, Math.max].map((pick) => Number(pick(...kept.map(({ margin }) => margin)).toPrecision(3)));
  const drawn = kept.filter((obstacle) => obstacle.margin_drawn);
  const missing = kept.length - drawn.length;
  const text = `${[...new Set(sizes)].join(" to ")} m${missing ? ` (${missing} not drawn)` : ""}`;
  const show = (on) => drawn.forEach((obstacle) => setVisible(["obstacles", obstacle.node, "margin"], on));
  addThing("margins", text, show, { color: story.colors.obstacle, opacity: 0.35 });
}

function addTrails() {
  const { colors } = story;
  if (story.run) {
    addThing("trails", "path ahead", toggles("current path"), { color: colors.trail });
    if (story.run.replaced.some((line) => line >= 0)) addThing("trails", "before a repair", toggles("replaced path"), { color: colors.before });
    addThing("trails", "path travelled", toggles("trail"), { color: colors.trail, opacity: 0.45, on: false });
  } else if (story.moves.length) addThing("trails", "path of the tip", toggles("trail", "beads"), { color: colors.trail });
  if (story.proof && story.proof.unproven.length) addThing("trails", "not proven free", () => {}, { color: colors.unproven });
  if (story.before) addThing("trails", `before: ${story.before}`, toggles("before"), { color: colors.before });
}

/** The colour of most triangles of a group. */
function mainColor(name) {
  const areas = new Map();
  node(name).traverse(({ isMesh, geometry, material }) => {
    if (!isMesh) return;
    const color = `#${material.color.getHexString()}`;
    areas.set(color, (areas.get(color) ?? 0) + (geometry.index?.count ?? 0));
  });
  return [...areas].sort(([, a], [, b]) => b - a)[0]?.[0] ?? null;
}

/** All that is drawn, in the order of the tree. */
function listThings() {
  const { colors } = story;
  if (robot) addThing("robot", robot.name, toggles("robot"), { color: mainColor("robot") });
  if (story.attached.length) addThing("robot", `held: ${story.attached.join(", ")}`, () => {}, { color: colors.attached });
  if (story.start_ghost) addThing("ghosts", "start", toggles("start ghost"), { color: colors.start, opacity: 0.6, on: story.ghosts.length === 0 });
  if (story.goal_ghost) addThing("ghosts", "goal", toggles("goal ghost"), { color: colors.goal, opacity: 0.6 });
  drawnGhosts.forEach(({ name, color }) => addThing("ghosts", name, toggles(name), { color, opacity: 0.6 }));
  addTrails();
  growing.forEach(({ name, color, leaf }) => addThing("search", name, toggles(leaf), { color }));
  if (story.goal && story.goal !== "joint values") addThing("goal", story.goal, (on) => setVisible(["goal"], on && goalNow() === story.goal), { color: colors.goal });
  if (node("constraints").children.length) addThing("goal", "path constraints", toggles("constraints"));
  for (const { name, node: leaf, color } of obstaclesNow()) {
    addThing("obstacles", name, (on) => setSeen(["obstacles", leaf], on), { color });
  }
  const courses = node("later").children.length;
  if (courses) addThing("courses", `of ${count(courses, "obstacle")}`, toggles("later"), { color: colors.obstacle, opacity: 0.6, on: courses <= FEW_COURSES });
  addMargins();
  if (story.contacts.length) addThing("contacts", "bodies that touch", (on) => setVisible(["contact"], on), { color: colors.touching });
  for (const { name, color, opacity, node: leaf, shown } of story.marks) {
    addThing("marks", name, (on) => setVisible(["marks", leaf], on), { color, opacity, on: shown });
  }
  if (labels.some(({ kind }) => kind === "waypoint")) addThing("labels", "numbers of moves", (on) => setLabels("waypoint", on), { on: story.moves.length <= FEW_MOVES });
  if (story.moves.length) addThing("labels", "start and goal", (on) => ["start", "goal"].forEach((kind) => setLabels(kind, on)));
  if (story.obstacles.length) addThing("labels", "names of obstacles", (on) => setLabels("obstacle", on), { on: false });
  addThing("frames", "world", toggles("frames"));
  if (robot) addThing("frames", `tip (${robot.tip.name})`, (on) => setVisible(["robot", robot.nodes[robot.tip.joint], "tip frame"], on));
  addThing("grid", `grid of ${story.grid} m`, toggles("grid"), { color: "#d2d9e0" });
}

/** An eye: open while what it stands for is to be seen. */
function eyeOf(name, on, change) {
  const eye = make("input", { type: "checkbox", className: "eye", checked: on, ariaLabel: `show ${name}` });
  eye.addEventListener("change", () => change(eye.checked));
  return eye;
}

function swatchOf({ color, opacity }) {
  const swatch = make("span", { className: color ? "swatch" : "swatch none" });
  if (color) Object.assign(swatch.style, { background: color, opacity });
  return swatch;
}

function thingRow(thing, text = thing.text) {
  const eye = eyeOf(text, thing.on, (on) => {
    thing.on = on;
    applyEyes(thing.group);
  });
  return make("li", {}, make("label", { title: text }, eye, swatchOf(thing), text));
}

function groupRow(name) {
  const members = things.filter(({ group }) => group === name);
  if (members.length === 1) return thingRow(members[0], `${GROUPS[name]}: ${members[0].text}`);
  const rows = make("ul", {}, ...members.map((thing) => thingRow(thing)));
  const eye = eyeOf(GROUPS[name], groupsOn[name], (on) => {
    groupsOn[name] = on;
    rows.classList.toggle("closed", !on);
    applyEyes(name);
  });
  const alike = new Set(members.map(({ color }) => color)).size === 1;
  const head = make("summary", {}, eye, ...(alike ? [swatchOf(members[0])] : []), `${GROUPS[name]} `, make("small", { textContent: members.length }));
  const open = UNFOLDED.includes(name) && members.length <= LONG_LIST;
  return make("li", {}, make("details", { open }, head, rows));
}

function buildTree() {
  const closed = things.filter(({ on }) => !on).map(({ text }) => text);
  const first = things.length === 0;
  things.length = 0;
  listThings();
  if (!first) things.forEach((thing) => { thing.on = !closed.includes(thing.text); });
  const used = Object.keys(GROUPS).filter((name) => things.some(({ group }) => group === name));
  document.getElementById("tree").replaceChildren(...used.map(groupRow));
  Object.assign(document.getElementById("coarser"), { textContent: story.coarser, hidden: !story.coarser });
  document.getElementById("see-through-label").hidden = story.obstacles.length === 0;
  applyEyes();
}

document.getElementById("see-through").addEventListener("change", (event) => seeThrough(event.target.checked));
