// The panel beside the picture: joints with units, list of moves, legend with switches.
const MINUS = "\u2212";
const FEW_MOVES = 12;  // up to here waypoints carry their numbers from the beginning

function make(tag, properties = {}, ...children) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}

/** A joint value as a person reads it: degrees with one decimal, metres with three. */
function reading(j, value) {
  const inDegrees = robot.joints[j].unit === "deg";
  const text = inDegrees ? ((value * 180) / Math.PI).toFixed(1) : value.toFixed(3);
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", MINUS);
}

function withUnit(j, value) {
  return `${reading(j, value)} ${robot.joints[j].unit}`;
}

const count = (number, noun) => `${number} ${noun}${number === 1 ? "" : "s"}`;

document.getElementById("title").textContent = story.title;

/** The line below the heading. */
function saySubtitle(obstacles, goal) {
  document.getElementById("subtitle").textContent = [
    robot ? `robot ${robot.name}, ${count(robot.joints.length, "joint")}` : "",
    robot || obstacles ? count(obstacles, "obstacle") : "",
    goal ? `goal: ${goal}` : "",
  ].filter((text) => text).join("  \u00b7  ");
}
saySubtitle(story.obstacles.length, story.goal);

// What search.js does, in pages of a planner's search and of two joints.
const growing = [];  // trees as they grow
let onPosture = () => {};
let showSearchOf = () => {};
let showShare = (share) => { if (total > 0) show(total * share); };  // of a film

// Joints -----------------------------------------------------------------------------------------------------------
const jointRows = [];
let onJointMoved = () => {};

function addJointRow(joint, j) {
  const bounded = joint.lower !== null && joint.upper !== null;
  const cell = make("td", { className: "range" });
  const row = { value: make("td", { className: "number" }), target: make("td", { className: "number" }), set: () => {} };
  if (bounded) cell.title = `limits ${withUnit(j, joint.lower)} to ${withUnit(j, joint.upper)}`;
  if (story.moves.length === 0) {
    const around = joint.unit === "deg" ? Math.PI : 1;
    const range = { type: "range", min: joint.lower ?? -around, max: joint.upper ?? around, step: "any" };
    const slider = make("input", { ...range, ariaLabel: `move ${joint.name}` });
    slider.addEventListener("input", () => onJointMoved(j, Number(slider.value)));
    row.set = (value) => { slider.value = value; };
    cell.append(slider);
  } else if (bounded) {
    const mark = make("i");
    row.set = (value) => { mark.style.left = `${(100 * (value - joint.lower)) / (joint.upper - joint.lower)}%`; };
    cell.append(make("div", { className: "meter" }, mark));
  } else {
    cell.append(make("span", { className: "endless", textContent: "no limits" }));
  }
  const name = make("td", { className: "name", textContent: joint.name, title: joint.name });
  row.element = make("tr", {}, name, row.value, row.target, cell);
  jointRows.push(row);
  return row.element;
}

function buildJoints() {
  document.getElementById("joints-section").hidden = false;
  document.getElementById("joints-note").textContent =
    story.moves.length ? "those that move are coloured" : "drag to move the arm";
  const heads = ["joint", "now", story.moves.length ? "move to" : "", story.moves.length ? "limits" : ""];
  const header = make("tr", {}, ...heads.map((textContent, k) => make("th", { textContent, className: k % 3 ? "number" : "" })));
  const table = document.getElementById("joints");
  table.classList.toggle("still", story.moves.length === 0);
  jointRows.length = 0;
  table.replaceChildren(header, ...robot.joints.map(addJointRow));
}

function showJoints(q, move, moving) {
  onPosture(q);
  q.forEach((value, j) => {
    const row = jointRows[j];
    const active = moving && move.joints.includes(j);
    row.value.textContent = withUnit(j, value);
    row.target.textContent = active ? `${"\u2192"} ${reading(j, move.to[j])}` : "";
    row.element.className = active ? "moving" : "";
    row.set(value);
  });
  const tip = tipPosition(q).toArray().map((x) => x.toFixed(3).replace("-", MINUS));
  document.getElementById("tip").textContent = `tip (${robot.tip.name}): x ${tip[0]}, y ${tip[1]}, z ${tip[2]} m`;
}

// Moves ------------------------------------------------------------------------------------------------------------
const moveRows = [];
let shownMove = null;
story.moves.forEach((move, k) => Object.assign(move, { from: story.waypoints[k], to: story.waypoints[k + 1] }));

function describe(k) {
  const { joints, from, to } = story.moves[k];
  if (joints.length === 0) return "stand still";
  const way = (j) => `${robot.joints[j].name} ${reading(j, from[j])} \u2192 ${withUnit(j, to[j])}`;
  if (joints.length <= 2) return joints.map(way).join(", ");
  const farthest = joints.reduce((best, j) => (Math.abs(to[j] - from[j]) > Math.abs(to[best] - from[best]) ? j : best));
  return `${joints.length} joints, mostly ${way(farthest)}`;
}

function buildMoves(goTo) {
  document.getElementById("moves-section").hidden = story.moves.length === 0;
  const table = document.getElementById("moves");
  table.replaceChildren();
  moveRows.length = 0;
  shownMove = null;
  table.append(make("tr", {}, make("th", { textContent: "no." }), make("th", { textContent: "joint and way" })));
  story.moves.forEach((_, k) => {
    const row = make("tr", {}, make("td", { textContent: k + 1 }), make("td", { textContent: describe(k) }));
    row.addEventListener("click", () => goTo(story.times[k]));
    moveRows.push(row);
    table.append(row);
  });
}

function showMove(k) {
  if (k === shownMove) return;
  if (shownMove !== null) moveRows[shownMove].className = "";
  shownMove = k;
  if (k === null) return;
  moveRows[k].className = "moving";
  const scroll = document.getElementById("moves-scroll");
  const [row, box] = [moveRows[k], scroll].map((element) => element.getBoundingClientRect());
  if (row.top < box.top || row.bottom > box.bottom) scroll.scrollTop += row.top - box.top - 40;
}

function labelObstacles() {
  for (const obstacle of story.obstacles) {
    const thing = node("obstacles", obstacle.node);
    const box = new THREE.Box3().setFromObject(thing).getCenter(new THREE.Vector3());
    addLabel(obstacle.name, "obstacle", { x: box.x, y: -box.z, z: box.y }, thing);
  }
}

/** Numbers at the waypoints, and words at both ends. */
function labelPath() {
  dropLabels("start", "goal", "waypoint");
  const last = story.moves.length;
  if (last === 0) return;
  const between = [...Array(last - 1).keys()].map((k) => k + 1);
  const places = [];
  for (const k of last <= 200 && !story.run && !story.timed ? [0, last, ...between] : [0, last]) {
    const text = k === 0 ? "start" : k === last ? "goal" : `${k}`;
    const tip = tipPosition(story.waypoints[k]);
    const same = places.find((place) => place.tip.distanceTo(tip) < 0.01 * size);
    if (!same) places.push({ tip, text, kind: k === 0 || k === last ? text : "waypoint" });
    else if (k === last || same.kind === "waypoint" || last <= FEW_MOVES) same.text += `, ${text}`;
  }
  places.forEach(({ tip, text, kind }) => addLabel(text, kind, tip));
  applyEyes("labels");
  placeLabels();  // at once: while a path is made shorter there is a new one in each picture
}

viewer.scene.updateMatrixWorld(true);
labelObstacles();
labelPath();
buildTree();
for (const name of Object.keys(VIEWPOINTS)) {
  const button = make("button", { textContent: name, title: `look from: ${name.toLowerCase()}` });
  button.addEventListener("click", () => lookFrom(name));
  document.getElementById("views").append(button);
}
