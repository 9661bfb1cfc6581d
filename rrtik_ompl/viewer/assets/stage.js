// The 3-D picture: meshcat's viewer with our light, ghosts, grid, labels and camera.
const pane = document.getElementById("pane");
const ROOT = ["meshcat"];
let viewer;
try {
  viewer = new MeshCat.Viewer(pane);
  performance.mark("viewer");
} catch (error) {
  const sorry = document.createElement("p");
  const picture = new Image();
  const drawn = document.getElementById("picture").textContent;
  sorry.textContent = `This browser cannot draw in 3-D: WebGL is missing or switched off.${drawn ? " The picture is the first view." : ""}`;
  Object.assign(picture, { id: "still", alt: "first view", src: `data:image/png;base64,${drawn}` });
  pane.replaceChildren(sorry, ...(drawn ? [picture] : []));
  throw error;
}
const low = new THREE.Vector3(...story.frame.low);
const high = new THREE.Vector3(...story.frame.high);
if (story.planar) low.z = high.z = 0;
const centre = low.clone().add(high).multiplyScalar(0.5);
const size = low.distanceTo(high);

for (const text of JSON.parse(document.getElementById("commands").textContent)) {
  viewer.handle_command_bytearray(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)));
}

function node(...path) {
  return viewer.scene_tree.find([...ROOT, ...path]).object;
}

const tipFrame = () => node("robot", robot.nodes[robot.tip.joint], "tip frame");

function setVisible(path, on) {
  viewer.scene_tree.find([...ROOT, ...path]).object.visible = on;
  viewer.set_dirty();
}

// Light and ground -------------------------------------------------------------------------------------------------
function rgb(color) {
  return [1, 3, 5].map((k) => parseInt(color.slice(k, k + 2), 16) / 255);
}
const dark = matchMedia("(prefers-color-scheme: dark)");
const toned = (name) => story.colors[dark.matches ? `${name}_dark` : name];

function showGround() {
  viewer.set_property(["Background"], "top_color", rgb(toned("background_top")));
  viewer.set_property(["Background"], "bottom_color", rgb(toned(story.planar ? "background_top" : "background_bottom")));
  addGrid();
}
for (const light of ["SpotLight", "PointLightNegativeX", "PointLightPositiveX", "AmbientLight", "FillLight"]) {
  viewer.set_property(["Lights", light], "visible", false);
}
viewer.set_property(["Grid"], "visible", false);
viewer.set_property(["Axes"], "visible", false);
const key = new THREE.DirectionalLight(0xffffff, 0.48);
key.position.set(0.5, -0.7, 1.2);
const fill = new THREE.DirectionalLight(0xffffff, 0.12);
fill.position.set(-1, 0.6, 0.3);
const sky = new THREE.HemisphereLight(0xffffff, 0x98a4b0, 0.53);  // together less than 1, so that white arms keep their form
sky.position.set(0, 0, 1);
key.position.multiplyScalar(2 * size).add(centre);
key.target.position.copy(centre);
[key, fill, sky, key.target].forEach((light, k) => viewer.set_object(["Lights", `page ${k}`], light));

// Soft shadows on the ground and on what stands there show what touches what. A browser that draws by software alone has coarser
// ones; films and pictures of the command line, which are drawn like that, take their time.
const SHADOW_PIXELS = document.getElementById("film") || !drawsBySoftware() ? 2048 : 768;
function drawsBySoftware() {
  const gl = viewer.renderer.getContext();
  const known = gl.getExtension("WEBGL_debug_renderer_info");
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(known ? gl.getParameter(known.UNMASKED_RENDERER_WEBGL) : "");
}

function castShadows() {
  if (story.planar) return;
  const reach = 0.65 * size;
  viewer.renderer.shadowMap.type = THREE.PCFShadowMap;  // the kind whose edges can be made softer
  key.castShadow = true;
  key.shadow.mapSize.set(SHADOW_PIXELS, SHADOW_PIXELS);
  key.shadow.radius = 3;
  key.shadow.normalBias = (3 * 2 * reach) / SHADOW_PIXELS;  // of a few pixels: surfaces cast none on themselves
  Object.assign(key.shadow.camera, { left: -reach, right: reach, bottom: -reach, top: reach, near: 0.1 * size, far: 6 * size });
  node().traverse((item) => { item.castShadow = item.receiveShadow = false; });
  shade(node("robot"));
  if (robot) tipFrame().traverse((item) => { item.castShadow = false; });
}

/** Let the solids of a group cast and receive shadows; what is seen through casts none. */
function shade(group) {
  group.traverse((item) => {
    if (item.isMesh) item.castShadow = item.receiveShadow = !item.material.transparent;
  });
}
castShadows();

/** What casts shadows, and where it is. */
function castersNow() {
  const found = [key.castShadow];
  viewer.scene.updateMatrixWorld();
  viewer.scene.traverseVisible((item) => {
    if (item.castShadow && item.layers.test(viewer.camera.layers)) found.push(item.id, ...item.matrixWorld.elements);
  });
  return found;
}

let castersDrawn = [];
/** Draw the shadows again if what casts them has moved: they cost as much as the picture. */
function renewShadows() {
  const casters = castersNow();
  const { shadowMap } = viewer.renderer;
  shadowMap.autoUpdate = false;
  if (casters.length === castersDrawn.length && casters.every((value, k) => value === castersDrawn[k])) return;
  shadowMap.needsUpdate = true;
  castersDrawn = casters;
}

const FADING = {  // of the lines of the ground with the distance from its middle
  vertexShader: `attribute vec3 color; uniform float reach; varying vec3 tone; varying vec2 at;
    void main() { tone = color; at = position.xz / reach; gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }`,
  fragmentShader: "varying vec3 tone; varying vec2 at; void main() { gl_FragColor = vec4(tone, 1.0 - smoothstep(0.3, 1.0, length(at))); }",
};

function addGrid() {
  const cell = story.grid;
  const wide = Math.max(high.x - low.x, high.y - low.y, size / 2) * (story.planar ? 2.5 : 1.5);
  const cells = 2 * Math.ceil(wide / cell);
  const grid = new THREE.GridHelper(cells * cell, cells, toned("grid_middle"), toned("grid"));
  grid.material = new THREE.ShaderMaterial({ ...FADING, uniforms: { reach: { value: wide } }, transparent: true, depthWrite: false });
  grid.rotation.x = Math.PI / 2;
  const shadows = new THREE.ShadowMaterial({ opacity: 0.2, depthWrite: false });  // a floor of the scene may lie below it
  const floor = new THREE.Mesh(new THREE.PlaneGeometry(cells * cell, cells * cell), shadows);
  floor.receiveShadow = true;
  const snap = (value) => Math.round(value / cell) * cell;
  const ground = new THREE.Group().add(grid, floor);
  ground.position.set(snap(centre.x), snap(centre.y), low.z - 0.01 * size);
  viewer.set_object([...ROOT, "grid"], ground);
}
showGround();
dark.addEventListener("change", showGround);

// Dark edges, in a darker tone of the surface, make flat-sided obstacles readable from every side.
function outline(group) {
  const meshes = [];
  if (!story.planar) shade(group);
  group.traverse((item) => { if (item.isMesh) meshes.push(item); });
  for (const mesh of meshes) {
    const color = mesh.material.color.clone().multiplyScalar(0.6);
    const index = mesh.geometry.index;
    if ((index && index.count > 60000) || mesh.material.transparent) continue;
    mesh.add(new THREE.LineSegments(new THREE.EdgesGeometry(mesh.geometry, 30), new THREE.LineBasicMaterial({ color })));
  }
}
outline(node("obstacles"));

/** A material that keeps its colour on the side away from the light: for paths and axes, whose colour says what they are. */
function glowing(material) {
  material.emissive.copy(material.color).multiplyScalar(0.7);
  material.color.multiplyScalar(0.35);
  return material;
}
for (const name of ["trail", "beads", "before", "frames", "goal"]) {
  node(name).traverse((item) => { if (item.isMesh) glowing(item.material); });
}
if (robot) tipFrame().traverse((item) => { if (item.isMesh) glowing(item.material); });

/** Points have no shading: those higher up are lighter, and all are round. */
function showPoints(points) {
  const dot = Object.assign(document.createElement("canvas"), { width: 32, height: 32 });
  const pen = dot.getContext("2d");
  pen.fillStyle = "#ffffff";
  pen.arc(16, 16, 15, 0, 2 * Math.PI);
  pen.fill();
  const { position } = points.geometry.attributes;
  const place = new THREE.Vector3();
  const heights = Array.from({ length: position.count }, (_, k) => place.fromBufferAttribute(position, k).applyMatrix4(points.matrixWorld).y);
  const [least, most] = heights.reduce(([a, b], height) => [Math.min(a, height), Math.max(b, height)], [Infinity, -Infinity]);
  const tones = heights.flatMap((height) => Array(3).fill(0.35 + (0.65 * (height - least)) / (most - least || 1)));
  points.geometry.setAttribute("color", new THREE.Float32BufferAttribute(tones, 3));
  Object.assign(points.material, { map: new THREE.CanvasTexture(dot), alphaTest: 0.5, vertexColors: true, needsUpdate: true });
}
viewer.scene.updateMatrixWorld(true);
node("obstacles").traverse((item) => { if (item.isPoints) showPoints(item); });

// Postures ---------------------------------------------------------------------------------------------------------
function setPosture(group, q) {
  const frames = jointFrames(q);
  robot.nodes.forEach((name, k) => {
    const joint = group.children.find((child) => child.name === name);
    if (joint) frames[k].decompose(joint.position, joint.quaternion, joint.scale);
  });
  viewer.set_dirty();
}

// Ghosts share the triangles of the arm. The first copy of each only fills the depth buffer, so that the second one shows the nearest
// surface alone and looks like tinted glass, not like a heap of overlapping shells. Each is a little farther away than the one before,
// so that the arm, or else the first of them, is seen where they coincide.
const DRAWN_GHOSTS = 8;  // as many of all solutions: more would hide each other
const LEAST_SHARE = 0.02;  // of its box that a solid fills
const GHOST_UNITS = 16;  // steps of the depth buffer from each ghost to the next one
const ghosts = [];
function tintGlass(glass, color) {
  glass.color.set(color);
  glass.emissive.set(color).multiplyScalar(dark.matches ? 0.7 : 0.3);
  return glass;
}

// three.js draws what is transparent and has two sides twice, and looks for its programs anew each time. Of a ghost the nearest
// surface alone is seen: it is called transparent when things are put in order, and opaque while it is drawn, with the same blending.
const DRAWN_ONCE = {
  onBeforeRender: (...[, , , , material]) => { material.transparent = false; },
  onAfterRender: (...[, , , , material]) => { material.transparent = true; },
};
const GLASS = { blending: THREE.CustomBlending, blendSrcAlpha: THREE.OneFactor, blendDstAlpha: THREE.OneMinusSrcAlphaFactor };

/** Whether triangles show their fronts to the outside of a volume, so that nobody sees their backs. */
function isSolid(geometry) {
  geometry.computeBoundingBox();
  const { position } = geometry.attributes;
  const corners = geometry.index?.array ?? [...Array(position.count).keys()];
  const centre = geometry.boundingBox.getCenter(new THREE.Vector3());
  const [a, b, c] = [0, 1, 2].map(() => new THREE.Vector3());
  let volume = 0;
  for (let k = 0; k + 2 < corners.length; k += 3) {
    [a, b, c].forEach((corner, n) => corner.fromBufferAttribute(position, corners[k + n]).sub(centre));
    volume += a.dot(b.cross(c)) / 6;
  }
  const box = geometry.boundingBox.getSize(a);
  return volume > LEAST_SHARE * box.x * box.y * box.z;
}
let solids = null;  // of the arm; looked for when there is a ghost
function solidsOf(group) {
  const found = new Set();
  group.traverse((item) => { if (item.isMesh && isSolid(item.geometry)) found.add(item.geometry); });
  return found;
}

function addGhost(name, color, q) {
  const depth = new THREE.MeshBasicMaterial({ colorWrite: false, transparent: true });
  const glass = tintGlass(new THREE.MeshLambertMaterial({ transparent: true, opacity: 0.55, depthWrite: false, ...GLASS }), color);
  const ghost = new THREE.Group();
  ghosts.push(ghost);
  solids ??= solidsOf(node("robot"));
  [depth, glass].forEach((material, pass) => {
    Object.assign(material, { polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: GHOST_UNITS * ghosts.length });
    const twoSided = Object.assign(material.clone(), { side: THREE.DoubleSide });
    const copy = node("robot").clone(true);
    const tipFrame = copy.getObjectByName("tip frame");
    if (tipFrame) tipFrame.parent.remove(tipFrame);
    copy.traverse((item) => { if (item.isMesh) Object.assign(item, { material: solids.has(item.geometry) ? material : twoSided, renderOrder: pass + 1, castShadow: false, ...DRAWN_ONCE }); });
    setPosture(copy, q);
    ghost.add(copy);
  });
  viewer.set_object([...ROOT, name], ghost);
}
if (robot && story.start_ghost) addGhost("start ghost", story.colors.start, story.start_ghost);
if (robot && story.goal_ghost) addGhost("goal ghost", story.colors.goal, story.goal_ghost);
const drawnGhosts = story.ghosts.filter((_, k) => k % Math.ceil(story.ghosts.length / DRAWN_GHOSTS) === 0);
const ghostColors = story.ghosts.slice(0, DRAWN_GHOSTS).map(({ color }) => color);
drawnGhosts.forEach((ghost, n) => {
  ghost.color = ghostColors[n];
  addGhost(ghost.name, ghost.color, ghost.q);
});

/** Whether two links are at the same place, but for rounding. */
function coincide(a, b) {
  return a.position.distanceTo(b.position) < 1e-7 * size && Math.abs(a.quaternion.dot(b.quaternion)) > 1 - 1e-12;
}

/** Where a ghost's link stands on the arm's own nothing of it is seen: it is not drawn. */
function hideGhostsBehindArm() {
  const arm = node("robot");
  const links = new Map(arm.children.map((link) => [link.name, link]));
  for (const ghost of ghosts) {
    for (const copy of ghost.children) {
      for (const link of copy.children) {
        const own = links.get(link.name);
        link.visible = !(arm.visible && own && coincide(own, link));
      }
    }
  }
}

/** Show the piece of the trail that is being travelled in full colour, the others paler; all of them where none is. */
function highlightPiece(piece) {
  for (const group of node("trail").children) {
    const on = piece === null || group.name === `piece ${piece}`;
    group.traverse((item) => {
      if (item.isMesh) Object.assign(item.material, { transparent: true, opacity: on ? 1 : 0.6 });
    });
  }
}

// Labels: HTML over the picture, moved along whenever it is drawn ----------------------------------------------------
const labels = [];

const worldPlace = (thing) => thing.getWorldPosition(new THREE.Vector3());

/** A label at a place, which goes with a thing if one is given, and is hidden with it. */
function addLabel(text, kind, position, thing = null) {
  const element = document.createElement("span");
  element.textContent = text;
  element.className = kind;
  element.hidden = true;  // until it has its place
  document.getElementById("labels").append(element);
  labels.push({ element, kind, position: new THREE.Vector3(position.x, position.z, -position.y), on: true, thing, from: thing && worldPlace(thing) });
}

function dropLabels(...kinds) {
  for (const label of labels.filter(({ kind }) => kinds.includes(kind))) {
    label.element.remove();
    labels.splice(labels.indexOf(label), 1);
  }
}

function setLabels(kind, on) {
  labels.filter((label) => label.kind === kind).forEach((label) => { label.on = on; });
  viewer.set_dirty();
}

function placeLabels() {
  const taken = [];
  for (const label of labels) {
    const { thing } = label;
    const way = thing ? worldPlace(thing).sub(label.from) : new THREE.Vector3();
    const place = label.position.clone().add(way).project(viewer.camera);
    label.element.hidden = !label.on || Math.abs(place.z) > 1 || thing?.visible === false;
    if (label.element.hidden) continue;
    label.wide ??= label.element.offsetWidth;
    label.tall ??= label.element.offsetHeight;
    const [x, y] = [(0.5 + 0.5 * place.x) * pane.clientWidth, (0.5 - 0.5 * place.y) * pane.clientHeight];
    const spots = spotsBeside(x, y, label);
    const spot = spots.find((box) => !taken.some((other) => overlap(box, other))) ?? spots[0];
    if (label.kind === "reach") keepInPicture(spot);
    taken.push(spot);
    label.spot = spot;  // films draw it there
    label.element.style.transform = `translate(${spot.x}px, ${spot.y}px)`;
  }
}

/** Where a label may stand, best first: right of its place and above it (the start: left), left, below, farther up. */
function spotsBeside(x, y, { kind, wide, tall }) {
  const columns = kind === "start" ? [x - wide - 9, x + 9] : [x + 9, x - wide - 9];
  const rows = [y - tall, y + 4, y - 2 * tall - 2, y + tall + 6];
  return rows.flatMap((top) => columns.map((left) => ({ x: left, y: top, wide, tall })));
}

function keepInPicture(spot) {
  spot.x = Math.max(0, Math.min(spot.x, pane.clientWidth - spot.wide - 1));  // widths are rounded
  spot.y = Math.max(0, Math.min(spot.y, pane.clientHeight - spot.tall));
}

function overlap(a, b) {
  return a.x < b.x + b.wide && b.x < a.x + a.wide && a.y < b.y + b.tall && b.y < a.y + a.tall;
}

// Camera -----------------------------------------------------------------------------------------------------------
const VIEWPOINTS = { Overview: story.overview, Front: [1, 0, 0.0], Side: [0, -1, 0], Top: [0, -0.001, 1] };
let viewpoint = story.planar ? "Top" : "Overview";
let turnedByHand = false;

/** Place the camera in a direction so that what must be seen fills the picture; meshcat's camera has y up: (x, z, -y). */
function lookFrom(name) {
  viewpoint = name;
  turnedByHand = false;
  const camera = viewer.camera;
  camera.fov = 32;
  camera.near = size / 200;
  camera.far = size * 60;
  const { eye, target } = fit(new THREE.Vector3(...VIEWPOINTS[name]).normalize(), Math.tan((camera.fov * Math.PI) / 360));
  camera.position.set(eye.x, eye.z, -eye.y);
  viewer.controls.target.set(target.x, target.z, -target.y);
  viewer.controls.update();
  camera.updateProjectionMatrix();
  viewer.set_dirty();
}

/** Where the eye and its target must be to see all that must be seen from a direction, as large and as central as it goes. */
function fit(away, tangent) {
  const right = new THREE.Vector3(0, 0, 1).cross(away).normalize();
  const up = away.clone().cross(right);
  const tall = tangent * 0.85;
  const wide = tall * (pane.clientWidth / Math.max(pane.clientHeight, 1));
  const target = centre.clone();
  let distance = 2 * size;
  for (let round = 0; round < 12; round += 1) {
    const spots = outermost().map((spot) => {
      const arm = spot.sub(target);
      const depth = Math.max(distance - arm.dot(away), 1e-6 * size);
      return [arm.dot(right) / depth / wide, arm.dot(up) / depth / tall];
    });
    const [x, y] = [0, 1].map((axis) => spots.map((spot) => spot[axis]));
    target.addScaledVector(right, 0.5 * (Math.max(...x) + Math.min(...x)) * distance * wide);
    target.addScaledVector(up, 0.5 * (Math.max(...y) + Math.min(...y)) * distance * tall);
    distance *= Math.max(0.5 * (Math.max(...x) - Math.min(...x)), 0.5 * (Math.max(...y) - Math.min(...y)), 0.5);
  }
  return { eye: target.clone().addScaledVector(away, distance), target };
}

function outermost() {
  return story.frame.points.map(([x, y, z]) => new THREE.Vector3(x, y, story.planar ? 0 : z));
}

viewer.controls.addEventListener("start", () => { turnedByHand = true; });
const resize = viewer.set_3d_pane_size.bind(viewer);
viewer.set_3d_pane_size = () => {
  resize(pane.clientWidth, pane.clientHeight);
  if (!turnedByHand) lookFrom(viewpoint);
};
viewer.set_3d_pane_size();
const render = viewer.render.bind(viewer);
viewer.render = () => {
  hideGhostsBehindArm();
  renewShadows();
  render();
  placeLabels();
};
