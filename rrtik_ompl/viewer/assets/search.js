// How the planner has searched: its trees in space, in the order in which they grew, and the joint space of two joints.
const found = JSON.parse(document.getElementById("search").textContent);
const GROWTH_SECONDS = [2, 8];  // shortest and longest duration of the whole growth
const STEPS_A_SECOND = 20;
const GROWTH_SHARE = 0.5;  // of a film that also plays a path
const TURN = Math.PI / 18;  // [rad]; of a joint, between two points of an edge
const MOST_PIECES = 8;  // of an edge
const CORNERS = 3;  // of the tubes, which are thin and many

/** Points of the tip along a straight motion in joint space. */
function edgePoints(from, to) {
  const turned = Math.max(...from.map((a, j) => Math.abs(to[j] - a)));
  const pieces = Math.min(Math.max(Math.ceil(turned / TURN), 1), MOST_PIECES);
  return Array.from({ length: pieces + 1 }, (_, k) => tipPosition(from.map((a, j) => a + ((to[j] - a) * k) / pieces)));
}

/** Thin tubes along lines; `ends` says how many indices belong to the first line, the first two, and so on. */
function thinTubes(lines, color, radius) {
  const [places, index, ends] = [[], [], []];
  for (const points of lines) {
    for (let k = 1; k < points.length; k += 1) {
      const way = points[k].clone().sub(points[k - 1]);
      if (way.lengthSq() < 1e-18) continue;
      const aside = new THREE.Vector3(0, 0, 1).cross(way);
      if (aside.lengthSq() < 1e-6 * way.lengthSq()) aside.set(1, 0, 0);
      aside.normalize();
      const up = way.clone().normalize().cross(aside);
      const first = places.length / 3;
      for (const end of [points[k - 1], points[k]]) {
        for (let c = 0; c < CORNERS; c += 1) {
          const angle = (2 * Math.PI * c) / CORNERS;
          const corner = end.clone().addScaledVector(aside, radius * Math.cos(angle)).addScaledVector(up, radius * Math.sin(angle));
          places.push(corner.x, corner.y, corner.z);
        }
      }
      for (let c = 0; c < CORNERS; c += 1) {
        const [a, b] = [first + c, first + ((c + 1) % CORNERS)];
        index.push(a, b, a + CORNERS, b, b + CORNERS, a + CORNERS);
      }
    }
    ends.push(index.length);
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.Float32BufferAttribute(places, 3));
  geometry.setIndex(index);
  geometry.computeVertexNormals();
  const material = new THREE.MeshLambertMaterial({ color, emissive: new THREE.Color(color).multiplyScalar(0.25), side: THREE.DoubleSide });
  return { mesh: new THREE.Mesh(geometry, material), ends };
}

/** How many of ascending numbers are at most a number. */
const upTo = (numbers, most) => { let k = 0; while (k < numbers.length && numbers[k] <= most) k += 1; return k; };

// What grows: first the links of MB-RRT, then the trees; each with the step in which each of its lines comes.
let lastStep = 0;
function addGrowing(part, name, lines, steps, radius) {
  const { mesh, ends } = thinTubes(lines, part.color, radius);
  const leaf = `search ${growing.length}`;
  viewer.set_object([...ROOT, leaf], mesh);
  growing.push({ ...part, name, leaf, mesh, ends, steps });
  lastStep = Math.max(lastStep, steps[steps.length - 1] ?? 0);
}

function buildSearch() {
  const rows = found.tree.vertices;
  for (const part of found.tree.links) {
    const lines = part.ends.map((ends) => [new THREE.Vector3(...ends.slice(0, 3)), new THREE.Vector3(...ends.slice(3))]);
    addGrowing(part, part.name, lines, lines.map((_, k) => k + 1), 0.0012 * size);
  }
  const later = lastStep;
  for (const part of found.tree.parts) {
    const lines = part.edges.map(([from, to]) => edgePoints(rows[from], rows[to]));
    addGrowing(part, `tree ${part.name}`.replace("tree roadmap", "roadmap"), lines, part.steps.map((step) => later + step), 0.0016 * size);
  }
}

let grownTo = 0;
let growingSince = null;
let drawJointSpace = () => {};

/** The search as it was after a step. */
function showSearch(step) {
  grownTo = Math.min(Math.max(step, 0), lastStep);
  const words = [];
  for (const { mesh, ends, steps, name, count: all } of growing) {
    const lines = upTo(steps, grownTo);
    mesh.geometry.setDrawRange(0, lines ? ends[lines - 1] : 0);
    words.push(`${name} ${grownTo >= lastStep ? all : lines}`);
  }
  document.getElementById("search-scrub").value = grownTo;
  document.getElementById("search-now").textContent = `step ${Math.floor(grownTo)} of ${lastStep}; edges: ${words.join(", ")}`;
  drawJointSpace();
  viewer.set_dirty();
}

function growOn(stamp) {
  if (growingSince === null) return;
  const seconds = Math.min(Math.max(lastStep / STEPS_A_SECOND, GROWTH_SECONDS[0]), GROWTH_SECONDS[1]);
  showSearch(grownTo + (lastStep * Math.min(Math.max(stamp - growingSince, 0), 250)) / 1000 / seconds);
  growingSince = stamp;
  if (grownTo < lastStep) requestAnimationFrame(growOn);
  else stopGrowing();
}

function stopGrowing() {
  growingSince = null;
  document.getElementById("search-play").textContent = "Grow";
}

function playSearch() {
  if (growingSince !== null) return stopGrowing();
  if (grownTo >= lastStep) showSearch(0);
  growingSince = performance.now();
  document.getElementById("search-play").textContent = "Pause";
  return requestAnimationFrame(growOn);
}

function wireSearch() {
  const scrub = document.getElementById("search-scrub");
  scrub.max = lastStep;
  scrub.addEventListener("input", () => { stopGrowing(); showSearch(Number(scrub.value)); });
  document.getElementById("search-play").addEventListener("click", playSearch);
  const step = (by) => () => { stopGrowing(); showSearch(Math.floor(grownTo) + by); };
  document.getElementById("search-back").addEventListener("click", step(-1));
  document.getElementById("search-forward").addEventListener("click", step(1));
}

// Joint space --------------------------------------------------------------------------------------------------------
const SQUARE = { left: 44, right: 380, top: 6, bottom: 296 };
const PLOT_DOT = 4.5;

/** The plot: what is blocked, the trees, the path, and where the arm is. */
function buildJointSpace() {
  const { low, high, cells, blocked } = found.joints;
  const plot = document.getElementById("joint-space");
  const [wide, tall] = [SQUARE.right - SQUARE.left, SQUARE.bottom - SQUARE.top];
  const put = (tag, attributes, text = "") => {
    const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    element.textContent = text;
    plot.append(element);
    return element;
  };
  const at = (q) => [SQUARE.left + (wide * (q[0] - low[0])) / (high[0] - low[0]), SQUARE.bottom - (tall * (q[1] - low[1])) / (high[1] - low[1])];
  const line = (rows) => rows.map((q, k) => `${k ? "L" : "M"}${at(q).map((x) => x.toFixed(1)).join(" ")}`).join("");

  document.getElementById("joint-space-section").hidden = false;
  put("path", { class: "blocked", d: blocked, transform: `translate(${SQUARE.left} ${SQUARE.bottom}) scale(${wide / cells} ${-tall / cells})` });
  put("rect", { class: "frame", x: SQUARE.left, y: SQUARE.top, width: wide, height: tall });
  for (const [j, ends] of [[0, [low[0], high[0]]], [1, [low[1], high[1]]]]) {
    for (const value of [ends[0], 0.5 * (ends[0] + ends[1]), ends[1]]) {
      const [x, y] = at(j === 0 ? [value, low[1]] : [low[0], value]);
      if (j === 0) put("text", { x, y: y + 14, "text-anchor": value === ends[1] ? "end" : value === ends[0] ? "start" : "middle" }, withUnit(j, value));
      else put("text", { x: x - 4, y: y + (value === ends[1] ? 9 : 4), "text-anchor": "end" }, reading(j, value));
    }
  }
  put("text", { x: 0.5 * (SQUARE.left + SQUARE.right), y: SQUARE.bottom + 28, "text-anchor": "middle" }, robot.joints[0].name);
  const [x, y] = [11, 0.5 * (SQUARE.top + SQUARE.bottom)];
  put("text", { x, y, "text-anchor": "middle", transform: `rotate(-90 ${x} ${y})` }, `${robot.joints[1].name} [${robot.joints[1].unit}]`);

  const grown = growing.filter(({ edges }) => edges).map((part) => ({ ...part, element: put("path", { class: "tree", stroke: part.color }) }));
  const route = put("path", { class: "route" });
  const moveDot = (dot, q) => {
    const [cx, cy] = at(q);
    dot.setAttribute("cx", cx);
    dot.setAttribute("cy", cy);
  };
  const newDot = (kind) => put("circle", { class: kind, r: PLOT_DOT });
  const ends = ["start", "goal"].filter((end) => story[`${end}_ghost`]).map((end) => [newDot(end), `${end}_ghost`]);
  const here = newDot("here");

  drawJointSpace = () => grown.forEach(({ edges, steps, element }) => {
    const rows = found.tree.vertices;
    element.setAttribute("d", edges.slice(0, upTo(steps, grownTo)).map((ends) => line(ends.map((k) => rows[k]))).join(""));
  });
  return (q) => {
    route.setAttribute("d", line(story.waypoints));
    ends.forEach(([dot, end]) => moveDot(dot, story[end]));
    moveDot(here, q);
  };
}

if (found.tree) {
  buildSearch();
  wireSearch();
  document.getElementById("search-section").hidden = false;
  document.getElementById("search-note").textContent = [`how ${found.tree.planner} searched`, found.tree.note].filter((text) => text).join("; ");
}
if (found.joints) onPosture = buildJointSpace();
if (found.tree) {
  showSearch(lastStep);
  buildTree();
  showShare = (share) => {  // a film grows the trees, then it plays the path
    showSearch(total > 0 ? (lastStep * share) / GROWTH_SHARE : lastStep * share);
    if (total > 0) show((total * Math.max(share - GROWTH_SHARE, 0)) / (1 - GROWTH_SHARE));
  };
}

/** The trees are shown with the path that they found, the joint space with each path among the same obstacles. */
const grownTrees = [...growing];
showSearchOf = ({ first, sameObstacles }) => {
  document.getElementById("joint-space-section").hidden = !found.joints || !sameObstacles;
  if (!found.tree || first === (growing.length > 0)) return;
  if (!first) stopGrowing();
  growing.splice(0, growing.length, ...(first ? grownTrees : []));
  grownTrees.forEach(({ leaf }) => setVisible([leaf], first));
  document.getElementById("search-section").hidden = !first;
  document.querySelectorAll("#joint-space .tree").forEach((tree) => { tree.style.display = first ? "" : "none"; });
  buildTree();
};
