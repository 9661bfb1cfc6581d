// What a person moves in the picture. A click selects a ghost or an obstacle; what is selected is moved by its handles, or dragged
// itself, with the shift key turned. All else turns the view.
const TURN_PER_PIXEL = 0.01;  // [rad], with the shift key or a ring that is seen from its edge
const GHOSTS_FIRST = 0.05;  // of the picture's size: so much nearer a ghost counts than it is
const CLICK_PIXELS = 4;  // a pointer that moves less clicks
const FREE_STEPS = 20;  // of the way back from the nearest pose that an arm can take, until it is free there
const OUT_OF_REACH = "#8a949e";  // colour of a ghost that cannot follow
let selected = "goal";
let held = planning?.tips[0] ?? robot?.tip;  // the tip by which a ghost is moved

/** The joints from a tip's to the base. */
function jointsOf(joint) {
  const found = [];
  for (let k = joint; k > 0; k = robot.parent[k - 1] + 1) found.push(k);
  return found;
}

/** The tip that a person means who takes hold of a solid: of those that share most joints with it the nearest. */
function tipOf(object, q, point) {
  let [solid, joint] = [object, -1];
  for (; solid && joint < 0; solid = solid.parent) joint = robot.nodes.indexOf(solid.name);
  const frames = jointFrames(q);
  const rank = planning.tips.map((tip) => ({
    tip,
    shared: jointsOf(tip.joint).filter((k) => jointsOf(joint).includes(k)).length,
    away: originOf(carried(tip, frames)).distanceTo(point),
  }));
  return rank.sort((a, b) => b.shared - a.shared || a.away - b.away)[0]?.tip ?? held;
}

/** Where a thing is: the tip of an end, or an obstacle. */
const poseOf = (thing) => (isEnd(thing) ? carried(held, jointFrames(state[thing])) : rowMajor(state.obstacles[thing].pose));

const isLocked = (thing) => !isEnd(thing) && (planning.obstacles[thing].locked || !isMovable(thing));
const nodeOf = (thing) => (isEnd(thing) ? node(ENDS.get(thing)) : node("obstacles", planning.obstacles[thing].node));
/** What is drawn of a thing: of a ghost the outer one of its two copies; undefined of one that is not drawn. */
const bodyOf = (thing) => (isEnd(thing) ? nodeOf(thing).children[0]?.children[0] : nodeOf(thing));

/** A pose that is moved by a shift [m], and turned about an axis through its origin or another point. */
function movedPose(pose, shift, angle, axis, centre = originOf(pose)) {
  const turn = new THREE.Matrix4().makeRotationAxis(axis, angle);
  const place = originOf(pose).sub(centre).applyMatrix4(turn).add(centre).add(shift);
  return turn.multiply(new THREE.Matrix4().extractRotation(pose)).setPosition(place);
}

/** Bring the tip that is held of an end to a pose, or as near as it comes; what keeps it from there, in words. */
function placeEnd(end, wanted) {
  const e = wanted.elements;
  const pose = [e[0], e[4], e[8], e[1], e[5], e[9], e[2], e[6], e[10], e[12], e[13], e[14]];
  const q = held.ik === undefined ? null : kernels.reach(pose, state[end], held);
  const near = q === null ? nearestReach(held, wanted, state[end]) : { q, out: false, text: "" };
  state[end] = near.text ? freeToward(near.q, state[end]) : near.q;
  farEnd = near.out ? end : null;
  const there = near.text && !kernels.free(near.q) ? `; there ${kernels.blame(near.q)}` : "";
  return near.text && `${end}: ${near.text}${there}`;
}

/** The nearest free joint values to some on the straight way from others: a ghost that cannot follow need not collide as well. */
function freeToward(to, from) {
  const shares = [...Array(FREE_STEPS + 1).keys()].map((k) => k / FREE_STEPS);
  return shares.map((share) => to.map((value, j) => value + share * (from[j] - value))).find((q) => kernels.free(q)) ?? to;
}

function moveObstacle(k, shift, turn) {
  placeObstacleAt(k, movedPose(rowMajor(state.obstacles[k].pose), shift, turn, AXES[2]));
}

function placeObstacleAt(k, wanted) {
  state.obstacles[k].pose = wanted.clone().transpose().elements.slice();
  applyObstacle(k);
}

const numberOf = (name) => planning.obstacles.findIndex((obstacle) => obstacle.name === name);

let farEnd = null;  // the end that cannot follow the pointer now
/** Bring what is selected to a pose; a path follows, and a word where it cannot go there. */
function placeSelected(wanted) {
  const word = isEnd(selected) ? placeEnd(selected, wanted) : (placeObstacleAt(selected, wanted), "");
  showSelected();
  changed();
  if (word) planRefusal(word, { mild: farEnd === null });
  if (drag) drag.word = farEnd === null ? "" : word;
  sayBesideHand();
}

/** Move what is selected by a shift [m] and a turn about z [rad]. */
function moveSelected(shift, turn) {
  placeSelected(movedPose(poseOf(selected), shift, turn, AXES[2]));
}

/** Why there is no path, or what keeps a ghost from following, stands beside the handle that is held. */
function sayBesideHand() {
  if (!drag?.wanted) return;
  const text = trouble || drag.word;
  dropLabels("reach");
  if (text) addLabel(text, "reach", originOf(drag.wanted));
  placeLabels();
}

// meshcat's picture has y up, the world z
const inWorld = ({ x, y, z }) => new THREE.Vector3(x, -z, y);
const fromWorld = ({ x, y, z }) => new THREE.Vector3(x, z, -y);
const ray = new THREE.Raycaster();
ray.params.Line.threshold = 0;  // edges are drawn as lines, and count as a metre thick by default
const rayInWorld = () => ({ origin: inWorld(ray.ray.origin), direction: inWorld(ray.ray.direction) });
function pointerAt(event) {
  const box = pane.getBoundingClientRect();
  const place = { x: (2 * (event.clientX - box.left)) / box.width - 1, y: 1 - (2 * (event.clientY - box.top)) / box.height };
  viewer.camera.updateMatrixWorld();
  ray.setFromCamera(place, viewer.camera);
}

/** What a pointer can take hold of: ghosts, but not in a run, and obstacles that are not locked. */
function thingsToDrag() {
  const free = [...planning.obstacles.keys()].filter((k) => !isLocked(k));
  const ends = clock.running ? [] : [...ENDS.keys()];
  return [...ends, ...free].filter((thing) => nodeOf(thing).visible && bodyOf(thing) !== undefined);
}

/** What is drawn under the pointer of all obstacles and the robot: its name, and whether it is the robot; undefined where there is none. */
function hitBody() {
  const obstacles = story.obstacles.map(({ name, node: leaf }) => ({ name, isRobot: false, body: node("obstacles", leaf) }));
  const bodies = [...obstacles, { name: robot.name, isRobot: true, body: node("robot") }].filter(({ body }) => body.visible);
  const hits = bodies.flatMap((each) => ray.intersectObject(each.body, true).slice(0, 1).map(({ distance }) => ({ ...each, distance })));
  return hits.sort((a, b) => a.distance - b.distance)[0];
}

/** A click that selects nothing says why: what is locked is selected, to be unlocked. */
function clickElsewhere() {
  const found = hitBody();
  if (!found) return;
  const { name, isRobot } = found;
  const k = numberOf(name);
  if (isRobot) planRefusal(`${name} itself follows the path: drag its start or its goal`, { mild: true });
  else if (k >= 0 && isMovable(k)) {
    select(k);
    planRefusal(`${name} is locked: it moves once "locked" below is off`, { mild: true });
  } else planRefusal(`${name} stays: boxes, balls, cylinders and capsules without a stated course can be moved here`, { mild: true });
}

function hitThing() {
  const hits = thingsToDrag().flatMap((thing) => ray.intersectObject(bodyOf(thing), true).slice(0, 1).map((hit) => ({ thing, name: nameOf(thing), hit })));
  const away = ({ thing, hit }) => hit.distance - (isEnd(thing) ? GHOSTS_FIRST * size : 0);
  return hits.sort((a, b) => away(a) - away(b))[0];
}

// The pointer ------------------------------------------------------------------------------------------------------
let drag = null;
let pressed = null;  // where a click may select something

/** What a drag of a handle, or else in the plane of the picture or of a planar arm, does to the pose where it began. */
function dragBy(handle, hitPoint) {
  const from = poseOf(selected);
  const centre = originOf(from);
  const none = new THREE.Vector3();
  if (!handle || handle.userData.kind === "knob") {
    const point = hitPoint ?? fromWorld(centre);
    const view = viewer.camera.getWorldDirection(new THREE.Vector3());
    const up = fromWorld(AXES[2]);
    const away = story.planar && Math.abs(view.dot(up)) > EDGE_ON ? up : view;  // a planar arm stays in its plane
    const plane = new THREE.Plane().setFromNormalAndCoplanarPoint(away, point);
    return () => {
      const spot = ray.ray.intersectPlane(plane, new THREE.Vector3());
      const shift = spot === null ? none : inWorld(spot.sub(point));
      if (story.planar) shift.z = 0;
      return movedPose(from, shift, 0, AXES[2]);
    };
  }
  const { kind, axis } = handle.userData;
  const line = AXES[axis];
  if (kind === "arrow") {
    const begin = alongAxis(line, centre);
    return () => movedPose(from, line.clone().multiplyScalar(alongAxis(line, centre) - begin), 0, line);
  }
  const begin = aroundAxis(line, centre);
  return (event) => {
    const now = begin === null ? (event.clientX - drag.x) * TURN_PER_PIXEL : (aroundAxis(line, centre) ?? begin) - begin;
    return movedPose(from, none, now, line);
  };
}

function startDrag(event) {
  if (event.button !== 0 || !event.isPrimary) return;
  pointerAt(event);
  const handle = hitHandle();
  const found = handle ? null : hitThing();
  pressed = handle ? null : { thing: found?.thing, hit: found?.hit, x: event.clientX, y: event.clientY };
  if (!handle && found?.thing !== selected) return;
  event.stopPropagation();
  event.preventDefault();
  if (found) holdTip(found);
  drag = { moves: dragBy(handle, found?.hit.point), from: poseOf(selected), x: event.clientX, y: event.clientY, begun: false, wanted: null, word: "" };
  pane.setPointerCapture(event.pointerId);
}

function holdTip({ thing, hit }) {
  if (isEnd(thing)) held = tipOf(hit.object, state[thing], inWorld(hit.point));
}

const clicked = (from, event) => Math.hypot(event.clientX - from.x, event.clientY - from.y) < CLICK_PIXELS;

function goOnDragging(event) {
  if (drag === null) return hover(event);
  event.stopPropagation();
  if (!drag.begun && clicked(drag, event)) return null;
  if (!drag.begun) remember();
  drag.begun = true;
  pointerAt(event);
  drag.wanted = event.shiftKey
    ? movedPose(drag.from, new THREE.Vector3(), (event.clientX - drag.x) * TURN_PER_PIXEL, AXES[2])
    : drag.moves(event);
  return placeSelected(drag.wanted);
}

function endDrag(event) {
  if (pressed && clicked(pressed, event)) {
    pointerAt(event);
    if (pressed.thing === undefined) clickElsewhere();
    else {
      holdTip(pressed);
      planRefusal("");
      select(pressed.thing);
    }
  }
  pressed = null;
  if (drag === null) return;
  event.stopPropagation();
  leaveDrag();
}

/** A drag that is given up: as if it had not begun. */
function giveUpDrag() {
  if (drag === null) return;
  const { begun } = drag;
  leaveDrag();
  if (begun) undo();
}

function leaveDrag() {
  drag = null;
  pressed = null;
  if (farEnd) planRefusal(document.getElementById("plan-refusal").textContent, { mild: true });  // the ghost stands where it can be
  farEnd = null;
  dropLabels("reach");
  for (const end of ENDS.keys()) showFree(end);
  viewer.set_dirty();
}

/** Outside of the picture nothing is under the pointer. */
function leavePane() {
  if (drag !== null) return;
  lightHandle(null);
  outlineThing(isLocked(selected) ? selected : null);
}

let looking = false;
/** Show what a press would take hold of, once a picture. */
function hover(event) {
  if (looking || event.buttons || handsHidden) return;
  looking = true;
  requestAnimationFrame(() => {
    looking = false;
    if (drag !== null) return;
    pointerAt(event);
    const handle = hitHandle();
    const found = handle ? null : hitThing();
    lightHandle(handle);
    outlineThing(found ? found.thing : isLocked(selected) ? selected : null);
    pane.style.cursor = handle || found?.thing === selected ? "grab" : found ? "pointer" : "";
    pane.title = found ? nameOf(found.thing) : "";
    viewer.set_dirty();
  });
}
