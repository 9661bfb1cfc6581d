// The page: takes files, asks the checker, says its answer, and plays the motion with the planes that prove it.
const LINK_COLOUR = [0.42, 0.52, 0.62, 1];
const OBSTACLE_COLOUR = [0.83, 0.58, 0.3, 1];
const HELD_COLOUR = [0.35, 0.6, 0.45, 1];
const CHOSEN_COLOUR = [0.84, 0.37, 0.0, 1];
const PLANE_COLOUR = [0.15, 0.5, 0.85, 0.45];
const SECONDS = 8; // that a motion takes when it is played
const MOST_LISTED = 2000; // entries of a motion in the list

const byId = (id) => document.getElementById(id);
const state = { files: new Map(), shown: null, place: 0, playing: false, plane: null };
let stage = null;

/** Take further files: what they say is checked anew with those that are there. */
async function takeFiles(list) {
  for (const file of list) state.files.set(file.webkitRelativePath || file.name, await file.arrayBuffer());
  checkAll();
}

/** The file whose path shares the longest end with a name, or null. */
function lookupFile(name) {
  const words = decodeURIComponent(name).replace(/^(package|file):\/\//, "").split(/[\\/]/).reverse();
  let best = { shared: 0, buffer: null };
  for (const [path, buffer] of state.files) {
    const parts = path.split("/").reverse();
    const shared = parts.findIndex((part, k) => part !== words[k]) >>> 0;
    if (Math.min(shared, parts.length) > best.shared) best = { shared: Math.min(shared, parts.length), buffer };
  }
  return best.buffer;
}

function say(text, kind) {
  byId("verdict").textContent = text;
  byId("verdict").className = kind;
}

function checkAll() {
  for (const id of ["motion", "entries", "unchecked-section"]) byId(id).hidden = true;
  state.shown = null;
  if (stage !== null) stage.clear();
  const files = [...state.files].map(([name, buffer]) => ({ name, buffer }));
  try {
    const given = readFiles(files, lookupFile);
    byId("told").replaceChildren(...given.told.map((text) => make("li", text)));
    if (given.certificate === null) {
      say("no certificate among the files", "");
      return;
    }
    const begin = performance.now();
    const verdict = checkAnyCertificate(given.certificate, given);
    const seconds = ((performance.now() - begin) / 1000).toFixed(2);
    say(verdict.holds ? `holds: ${factsInWords(given.certificate, verdict.facts)} (${seconds} s)` : `does not hold: ${verdict.fault}`, verdict.holds ? "holds" : "fails");
    if (verdict.holds) tellUnchecked(verdict.facts.unchecked);
    show(given, verdict.holds);
  } catch (error) {
    say(`cannot be read: ${error.message}`, "fails");
  }
}

function factsInWords(file, facts) {
  const parts = file.parts ?? [file];
  const listed = parts.flatMap((part) => part.motions);
  const motions = listed.length;
  const entries = listed.reduce((sum, motion) => sum + motion.length, 0);
  const clearance = Math.min(...parts.map((part) => part.clearance));
  const believed = [facts.readRobot ? null : "the robot", facts.readScene ? null : "the scene"].filter((word) => word !== null);
  const kept = parts.reduce((sum, part) => sum + (part.constraints?.length ?? 0), 0);
  const constraints = kept > 0 ? `, ${kept} path constraint${kept === 1 ? "" : "s"} kept` : "";
  const tips = facts.tips.length > 0 ? `; ${facts.tips.join(", ")} taken for the tip` : "";
  const taken = believed.length > 0 ? `; of ${believed.join(" and ")} that the certificate describes` : "";
  return `${motions} motion${motions === 1 ? "" : "s"} proven free, ${(1000 * clearance).toPrecision(3)} mm kept from obstacles, ${facts.pairs} pairs, ${entries} entries${constraints}${tips}${taken}`;
}

function make(tag, text) {
  const made = document.createElement(tag);
  made.textContent = text;
  return made;
}

function tellUnchecked(rows) {
  byId("unchecked-section").hidden = rows.length === 0;
  byId("unchecked").replaceChildren(...rows.map((row) => {
    const line = document.createElement("tr");
    line.append(...row.map((text) => make("td", text)));
    return line;
  }));
}

// ---- drawing ----------------------------------------------------------------------------------------------------

/** Draw what the certificate is about, even if it does not hold: as far as files describe it. */
function show(given, holds) {
  const file = given.certificate.parts?.[0] ?? given.certificate; // of a task the first motion
  const own = { ...given, ...given.parts?.[0] };
  let [world, motions] = [null, null];
  try {
    checkForm(file);
    world = readingOf(file, own);
    motions = motionsOf(file, world.joints, world.tracks);
  } catch (error) {
    return; // the verdict says what is wrong
  }
  stage ??= new Stage(byId("stage"));
  const solids = world.bodies.map((body) => {
    const colour = { link: LINK_COLOUR, obstacle: OBSTACLE_COLOUR, attached: HELD_COLOUR }[body.kind];
    const triangles = body.solid.plane === undefined ? bodyTriangles(body) : planeTriangles(scaled(body.solid.plane.normal, body.solid.plane.offset), body.solid.plane.normal, 2);
    return stage.add(triangles, colour, body.joint === 0 ? body.pose : IDENTITY);
  });
  state.shown = { file, world, solids, motions, proof: holds ? new Proof(file, worldOf(file, own)) : null };
  stage.look([0, 0, 0.3], extentOf(world, motions));

  for (const id of ["motion", "entries"]) byId(id).hidden = false;
  goTo(0);
}

function bodyTriangles(body) {
  const drawn = drawnTriangles(body.shape);
  return drawn.length > 0 ? drawn : surfaceOf(body).triangles;
}

/** A radius that the robot and what is near it fit into. */
function extentOf({ bodies }, motions) {
  const frames = motions[0].frames(0);
  const reaches = bodies.filter((body) => body.kind === "link").flatMap((body) => body.solid.points.map((point) => length(moved(chained(frames[body.joint], body.pose), point))));
  return reaches.reduce((most, reach) => Math.max(most, reach), 0.3);
}

function goTo(place) {
  const { world, motions, solids, file } = state.shown;
  state.place = place;
  byId("time").value = String(place);
  const along = Math.min(place * motions.length, motions.length - 1e-9);
  const m = Math.floor(along);
  const frames = motions[m].frames(along - m);
  world.bodies.forEach((body, k) => { solids[k].pose = chained(frames[body.joint], body.pose); });
  byId("place").textContent = `motion ${m + 1} of ${motions.length}, ${(along - m).toFixed(3)} of it`;
  if (byId("entry").dataset.motion !== String(m)) listEntries(m, file, world);
  placePlane(frames);
  stage.draw();
}

function listEntries(m, file, world) {
  const list = file.motions[m].slice(0, MOST_LISTED);
  byId("entry").dataset.motion = String(m);
  byId("count").textContent = `of motion ${m + 1}: ${file.motions[m].length}`;
  byId("entry").replaceChildren(...list.map((entry, k) => {
    const [i, j, level, number] = entry.length === 4 ? entry : [entry[0], entry[2], entry[4], entry[5]];
    const how = { 4: "distance", 6: "balls", 9: "plane" }[entry.length];
    const option = make("option", `${how}  ${world.bodies[i].name} | ${world.bodies[j].name}  ${(number / 2 ** level).toFixed(3)} .. ${((number + 1) / 2 ** level).toFixed(3)}`);
    option.value = String(k);
    return option;
  }));
  choose(null);
}

function choose(entry) {
  if (state.plane !== null) stage.remove(state.plane.solid);
  state.plane = null;
  const { world, solids, motions, file } = state.shown;
  world.bodies.forEach((body, k) => { solids[k].colour = { link: LINK_COLOUR, obstacle: OBSTACLE_COLOUR, attached: HELD_COLOUR }[body.kind]; });
  byId("said").textContent = "";
  if (entry === null) return;

  const m = Number(byId("entry").dataset.motion);
  const measured = entry.length === 4;
  const [i, a, j, b, level, number] = measured ? [entry[0], 0, entry[1], 0, entry[2], entry[3]] : entry;
  for (const k of [i, j]) solids[k].colour = CHOSEN_COLOUR;
  const begin = number / 2 ** level;
  byId("said").textContent = `'${world.bodies[i].name}' and '${world.bodies[j].name}', from ${begin.toFixed(4)} to ${(begin + 2 ** -level).toFixed(4)} of motion ${m + 1}`;
  if (entry.length === 9 && state.shown.proof !== null) {
    const { proof } = state.shown;
    const pair = proof.pairOf.get(`${i} ${j}`);
    const normal = scaled(entry.slice(6), 1 / length(entry.slice(6)));
    const shares = [begin, begin + 2 ** -level];
    const [first, second] = proof.poses(pair, m, shares);
    const low = Math.min(...first.map((pose) => -proof.reach(i, proof.nodes[i][a], pose, scaled(normal, -1))));
    const high = Math.max(...second.map((pose) => proof.reach(j, proof.nodes[j][b], pose, normal)));
    const centre = moved(second[0], proof.nodes[j][b].centre);
    const near = moved(first[0], proof.nodes[i][a].centre);
    const between = middle(centre, near);
    const point = add(between, scaled(normal, (low + high) / 2 - dot(normal, between)));
    const half = Math.max(0.1, 1.2 * proof.nodes[i][a].radius);
    state.plane = { solid: stage.add(planeTriangles(point, normal, half), PLANE_COLOUR), base: pair.base };
    byId("said").textContent += `: a plane with ${(1000 * (low - high)).toFixed(2)} mm between them`;
  }
  goTo((m + begin + 0.5 * 2 ** -level) / motions.length);
}

function placePlane(frames) {
  if (state.plane !== null) state.plane.solid.pose = frames[state.plane.base];
}

function play(before) {
  if (!state.playing || state.shown === null) return;
  const now = performance.now();
  goTo((state.place + (now - before) / (1000 * SECONDS)) % 1);
  requestAnimationFrame(() => play(now));
}

byId("play").addEventListener("click", () => {
  state.playing = !state.playing;
  byId("play").textContent = state.playing ? "Stop" : "Play";
  play(performance.now());
});
byId("time").addEventListener("input", (event) => { if (state.shown !== null) goTo(Number(event.target.value)); });
byId("entry").addEventListener("change", (event) => choose(state.shown.file.motions[Number(event.target.dataset.motion)][Number(event.target.value)]));
for (const id of ["files", "folder"]) byId(id).addEventListener("change", (event) => takeFiles(event.target.files));
byId("again").addEventListener("click", () => {
  state.files.clear();
  checkAll();
  byId("told").replaceChildren();
  say("Drop a certificate, a robot (URDF with its meshes, SRDF) and a scene here.", "");
});
window.addEventListener("resize", () => { if (state.shown !== null) stage.draw(); });
document.addEventListener("dragover", (event) => {
  event.preventDefault();
  document.body.classList.add("dropping");
});
document.addEventListener("dragleave", () => document.body.classList.remove("dropping"));
document.addEventListener("drop", async (event) => {
  event.preventDefault();
  document.body.classList.remove("dropping");
  takeFiles(await droppedFiles(event.dataTransfer));
});

/** All files that were dropped, those in folders with their paths. */
async function droppedFiles(transfer) {
  const found = [];
  const walk = async (entry, path) => {
    if (entry.isFile) {
      const file = await new Promise((resolve, reject) => entry.file(resolve, reject));
      found.push({ webkitRelativePath: path + entry.name, name: entry.name, arrayBuffer: () => file.arrayBuffer() });
      return;
    }
    const reader = entry.createReader();
    for (;;) {
      const entries = await new Promise((resolve, reject) => reader.readEntries(resolve, reject));
      if (entries.length === 0) return;
      for (const each of entries) await walk(each, `${path}${entry.name}/`);
    }
  };
  const entries = [...transfer.items].map((item) => item.webkitGetAsEntry()).filter((entry) => entry !== null);
  for (const entry of entries) await walk(entry, "");
  return found.length > 0 ? found : [...transfer.files];
}

globalThis.checkerPage = { takeFiles, goTo, choose, state };
