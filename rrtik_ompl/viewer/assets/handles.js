// Handles of what is selected: three arrows and three rings along the axes of the world; and the outline of what the pointer meets.
const HANDLE_SHARE = 0.1;  // of the picture's height that an arrow is long
const AXIS_COLORS = ["#d64545", "#3a9d3a", "#3a6fd8"];  // x, y, z
const LIT = "#f5b301";  // of a handle under the pointer
const OUTLINE = 2.5;  // [pixels]
const KNOB_COLOR = "#56636f";  // of the ball in the middle, by which a thing is moved in the plane of the picture
const END_ON = 0.95;  // cosine of the angle between view and arrow above which the arrow cannot be pulled
const EDGE_ON = 0.15;  // sine of the angle between view and ring below which the ring cannot be turned by its plane
const handles = new THREE.Group();
const namePlace = new THREE.Group();  // where the name of what is selected stands
const AXES = [0, 1, 2].map((k) => new THREE.Vector3().setComponent(k, 1));

/** A part of the handles, seen through everything, and a thicker one that the pointer finds. */
function addHandle(kind, axis, geometries, grip) {
  const color = kind === "knob" ? KNOB_COLOR : AXIS_COLORS[axis];
  const material = new THREE.MeshBasicMaterial({ color, depthTest: false, transparent: true, opacity: 0.9 });
  const part = new THREE.Group();
  const turned = (geometry) => new THREE.Mesh(geometry, material);
  part.add(...geometries.map(turned));
  part.add(Object.assign(new THREE.Mesh(grip), { visible: false }));  // the pointer meets what is not seen, too
  part.quaternion.setFromUnitVectors(AXES[1], AXES[axis]);  // arrows of three.js point along y
  part.traverse((item) => { item.renderOrder = 20; });
  Object.assign(part.userData, { kind, axis, material, color });
  handles.add(part);
}

function buildHandles() {
  const flat = story.planar ? [0, 1] : [0, 1, 2];
  for (const axis of flat) {
    const shaft = new THREE.CylinderGeometry(0.022, 0.022, 0.8, 8).translate(0, 0.5, 0);
    const head = new THREE.ConeGeometry(0.075, 0.24, 16).translate(0, 1.0, 0);
    addHandle("arrow", axis, [shaft, head], new THREE.CylinderGeometry(0.13, 0.13, 1.0, 6).translate(0, 0.66, 0));
  }
  for (const axis of story.planar ? [2] : flat) {
    const ring = (thick, parts) => new THREE.TorusGeometry(0.72, thick, parts, 48).rotateX(Math.PI / 2);
    addHandle("ring", axis, [ring(0.018, 6)], ring(0.09, 4));
  }
  addHandle("knob", 2, [new THREE.SphereGeometry(0.07, 16, 12)], new THREE.SphereGeometry(0.15, 8, 6));
  handles.visible = false;
  viewer.set_object([...ROOT, "handles"], handles);
  viewer.set_object([...ROOT, "name place"], namePlace);
}

/** Where the handles are: with the pose that is asked for while one is held. */
function placeHandles() {
  const shown = !handsHidden && !clock.running && nodeOf(selected).visible && bodyOf(selected) !== undefined;
  handles.visible = shown && !isLocked(selected);
  namePlace.visible = shown;
  namePlace.position.setFromMatrixPosition(drag?.wanted ?? poseOf(selected));
  outlineMaterial.uniforms.wide.value.set((2 * OUTLINE) / pane.clientWidth, (2 * OUTLINE) / pane.clientHeight);
  if (!handles.visible) return;
  handles.position.copy(namePlace.position);
  const view = fromWorld(handles.position).sub(viewer.camera.position);
  const away = view.length();
  for (const part of handles.children) part.visible = part.userData.kind !== "arrow" || Math.abs(inWorld(view).dot(AXES[part.userData.axis])) < END_ON * away;
  const tangent = Math.tan((viewer.camera.fov * Math.PI) / 360);
  handles.scale.setScalar(2 * away * tangent * HANDLE_SHARE * Math.max(1, 420 / Math.max(pane.clientHeight, 1)));
}

const handleOf = (object) => (object.userData.kind ? object : handleOf(object.parent));

/** The handle under the pointer, or null: in the middle the ball, whatever is before it. */
function hitHandle() {
  if (!handles.visible) return null;
  const hits = ray.intersectObject(handles, true).filter(({ object }) => !object.visible).map(({ object }) => handleOf(object));
  const seen = hits.filter(({ visible }) => visible);
  return seen.find(({ userData }) => userData.kind === "knob") ?? seen[0] ?? null;
}

function lightHandle(lit) {
  for (const { userData } of handles.children) userData.material?.color.set(userData === lit?.userData ? LIT : userData.color);
}

// How far along an axis, or around it, the pointer is ------------------------------------------------------------------
/** The place on an axis through a point that is nearest to the pointer's ray [m]. */
function alongAxis(axis, centre) {
  const { origin, direction } = rayInWorld();
  const apart = origin.sub(centre);
  const slant = axis.dot(direction);
  const square = Math.max(1 - slant * slant, 1e-3);
  return (axis.dot(apart) - slant * direction.dot(apart)) / square;
}

/** The angle of the pointer around an axis through a point [rad]; null where the ring is seen from its edge. */
function aroundAxis(axis, centre) {
  const { origin, direction } = rayInWorld();
  if (Math.abs(axis.dot(direction)) < EDGE_ON) return null;
  const spot = direction.clone().multiplyScalar(axis.dot(centre.clone().sub(origin)) / axis.dot(direction)).add(origin).sub(centre);
  const [right, up] = [1, 2].map((k) => AXES[(AXES.indexOf(axis) + k) % 3]);
  return Math.atan2(spot.dot(up), spot.dot(right));
}

// The outline: the far sides of a thing's surfaces, drawn a little larger ------------------------------------------------
const outlineMaterial = new THREE.ShaderMaterial({
  side: THREE.BackSide,
  transparent: true,
  depthWrite: false,
  uniforms: { color: { value: new THREE.Color(LIT) }, wide: { value: new THREE.Vector2() } },
  vertexShader: `uniform vec2 wide;
    void main() {
      vec2 aside = (projectionMatrix * vec4(normalMatrix * normal, 0.0)).xy;
      gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
      gl_Position.xy += wide * gl_Position.w * aside / max(length(aside), 1e-6);
    }`,
  fragmentShader: "uniform vec3 color; void main() { gl_FragColor = vec4(color, 1.0); }",
});
let outlined = null;
let outlines = [];

/** Outline a thing, or none. */
function outlineThing(thing) {
  if (thing === outlined) return;
  outlined = thing;
  outlines.forEach((each) => each.removeFromParent());
  outlines = thing === null ? [] : meshesOf(thing).map((mesh) => {
    const hull = Object.assign(new THREE.Mesh(mesh.geometry, outlineMaterial), { renderOrder: 3, raycast: () => {} });
    hull.updateMatrixWorld = () => hull.matrixWorld.copy(mesh.matrixWorld);  // no part of the thing, whose colours others change
    viewer.scene.add(hull);
    return hull;
  });
  viewer.set_dirty();
}

function meshesOf(thing) {
  const found = [];
  bodyOf(thing)?.traverse((item) => { if (item.isMesh && item.layers.test(viewer.camera.layers)) found.push(item); });
  return found;
}

let handsHidden = false;
hideHands = (hidden) => {
  handsHidden = hidden;
  outlineThing(null);
};
