// What a person moves in the picture: ghosts by their tips, obstacles, by mouse or finger; with the shift key they turn.
const TURN_PER_PIXEL = 0.01;  // [rad], with the shift key
const GHOSTS_FIRST = 0.05;  // of the picture's size: so much nearer a ghost counts than it is
let selected = "goal";
let held = planning?.tips[0];  // the tip by which a ghost is moved

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
    away: new THREE.Vector3().setFromMatrixPosition(carried(tip, frames)).distanceTo(point),
  }));
  return rank.sort((a, b) => b.shared - a.shared || a.away - b.away)[0]?.tip;
}

/** Move the tip that is held of an end by a shift [m] and a turn about z [rad], through inverse kinematics. */
function moveEnd(end, shift, turn) {
  if (held === undefined) return false;
  const frame = carried(held, jointFrames(state[end]));
  const e = new THREE.Matrix4().makeRotationZ(turn).multiply(new THREE.Matrix4().extractRotation(frame)).elements;
  const at = new THREE.Vector3().setFromMatrixPosition(frame).add(shift);
  const pose = [e[0], e[4], e[8], e[1], e[5], e[9], e[2], e[6], e[10], at.x, at.y, at.z];
  const q = kernels.reach(pose, state[end], held);
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
  const moved = isEnd(selected) ? moveEnd(selected, shift, turn) : (moveObstacle(selected, shift, turn), true);
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
  const ends = [...ENDS].map(([end, ghost]) => ({ thing: end, object: node(ghost) }));
  const solids = planning.obstacles.map((obstacle, k) => ({ thing: k, object: node("obstacles", obstacle.node), shown: isMovable(k) }));
  return [...ends, ...solids].filter(({ object, shown }) => shown !== false && object.visible);
}

function hitThing() {
  const hits = thingsToDrag().flatMap(({ thing, object }) => ray.intersectObject(object, true).slice(0, 1).map((hit) => ({ thing, name: nameOf(thing), hit })));
  const away = ({ thing, hit }) => hit.distance - (isEnd(thing) ? GHOSTS_FIRST * size : 0);
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
  select(found.thing);
  const { point } = found.hit;
  if (isEnd(found.thing)) held = tipOf(found.hit.object, state[found.thing], new THREE.Vector3(point.x, -point.z, point.y));  // meshcat's picture has y up
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
