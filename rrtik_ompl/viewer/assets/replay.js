// Replay of a run: obstacles where they were, the path that the robot followed, and the one that a repair replaced.
const run = story.run;
const lineGroups = [];
let shownLines = "";

function lineMesh(points, color, radius) {
  const curve = new THREE.CurvePath();
  const spots = points.map((point) => new THREE.Vector3(...point));
  for (let k = 1; k < spots.length; k += 1) curve.add(new THREE.LineCurve3(spots[k - 1], spots[k]));
  const material = glowing(new THREE.MeshPhongMaterial({ color, shininess: 10 }));
  return new THREE.Mesh(new THREE.TubeGeometry(curve, 3 * points.length, radius, 6), material);
}

/** Show one of the paths under a name in the scene tree, or none. */
function showLine(name, number, color, radius) {
  const group = new THREE.Group();
  if (number >= 0 && run.lines[number].length > 1) group.add(lineMesh(run.lines[number], color, radius));
  viewer.set_object([...ROOT, name], group);
}

/** The pose between two of a list, at a place such as 2.5. */
function poseBetween(poses, place) {
  const k = Math.min(Math.floor(place), poses.length - 1);
  const [a, b] = [poses[k], poses[Math.min(k + 1, poses.length - 1)]];
  const spot = new THREE.Vector3(...a.slice(0, 3)).lerp(new THREE.Vector3(...b.slice(0, 3)), place - k);
  const turn = new THREE.Quaternion(...a.slice(3)).slerp(new THREE.Quaternion(...b.slice(3)), place - k);
  return new THREE.Matrix4().compose(spot, turn, new THREE.Vector3(1, 1, 1));
}

/** Fingers where they are in a tick: what is drawn is moved on its joint. */
const drawnFingers = new Map();
function showFingers(tick, share) {
  const { bodies, at } = story.fingers;
  const place = at[tick] + share * (at[Math.min(tick + 1, at.length - 1)] - at[tick]);
  for (const { joint, name, poses } of bodies) {
    const group = node("robot", joint, name);
    if (!drawnFingers.has(group)) drawnFingers.set(group, group.matrix.clone());
    const pose = poseBetween(poses, place).multiply(drawnFingers.get(group));
    pose.decompose(group.position, group.quaternion, group.scale);
  }
}

function showRun(time, tick, share) {
  for (const [name, { placement, poses, shown }] of Object.entries(run.moving)) {
    const group = node("obstacles", name);
    if (shown) group.visible = shown[tick];
    const pose = poseBetween(poses, tick + share).multiply(rowMajor(placement));
    pose.decompose(group.position, group.quaternion, group.scale);
  }
  if (story.fingers) showFingers(tick, share);
  const wanted = `${run.line[tick]} ${run.replaced[tick]}`;
  if (wanted !== shownLines) {
    shownLines = wanted;
    showLine("current path", run.line[tick], story.colors.trail, 0.004 * size);
    showLine("replaced path", run.replaced[tick], story.colors.before, 0.003 * size);
  }
  viewer.set_dirty();
}

const groupOf = [];
if (run) run.groups.forEach((group, k) => { for (let n = 0; n < group.count; n += 1) groupOf.push(k); });

/** What happens now in a few words: the stage of a task, or what replanning does. */
const captionNow = () => (run ? run.groups[groupOf[Math.min(moveAt(now), groupOf.length - 1)]].caption : "");

function nowText(tick, arrived) {
  const { event, text } = run.groups[groupOf[tick]];
  const which = event === "motion" ? ` (motion ${groupOf[tick] + 1} of ${run.groups.length})` : "";
  return `${now.toFixed(2)} s: ${arrived ? run.outcome : text + which}`;
}

/** The list of what happened, one row for ticks of the same kind. */
function buildEvents(goTo) {
  document.getElementById("moves-section").hidden = false;
  document.querySelector("#moves-section h2").firstChild.textContent = run.groups[0]?.event === "motion" ? "Motions " : "Events ";
  const table = document.getElementById("moves");
  table.append(make("tr", {}, make("th", { textContent: "no." }), make("th", { textContent: "when and what" })));
  run.groups.forEach((group, k) => {
    const row = make("tr", { className: group.event }, make("td", { textContent: k + 1 }), make("td", { textContent: `${story.times[group.first].toFixed(2)} s: ${group.text}` }));
    row.addEventListener("click", () => goTo(story.times[group.first]));
    for (let n = 0; n < group.count; n += 1) moveRows.push(row);
    table.append(row);
  });
}
