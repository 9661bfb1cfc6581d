// The player: one time, set by buttons, keys, the scrub bar, the list of moves, the address, or by playing.
let total = 0;
const scrub = document.getElementById("scrub");
let now = 0;
let playingSince = null;
let showClearance = () => {};
let trouble = "";  // why there is no path, in pages that plan

function show(time) {
  now = Math.min(Math.max(time, 0), total);
  const q = postureAt(now);
  setPosture(node("robot"), q);
  const k = moveAt(now);
  const arrived = now >= total;
  showJoints(q, story.moves[k], !arrived);
  if (!story.timed) showMove(arrived ? null : k);
  highlightPiece(arrived || now === 0 ? null : story.moves[k].piece);
  scrub.value = now;
  showClearance(now);
  const place = placeAt(now);
  showContact(place);
  if (run) showRun(now, arrived ? k + 1 : k, arrived ? 0 : (now - story.times[k]) / (story.times[k + 1] - story.times[k]));
  document.getElementById("now").textContent = run ? nowText(k, arrived) : story.timed
    ? `${now.toFixed(2)} of ${total.toFixed(2)} s` : arrived
    ? `Goal reached after ${count(story.moves.length, "move")}`
    : `Move ${k + 1} of ${story.moves.length}: ${describe(k)}`;
  sayContact();
}

/** A time as a number of a motion plus the share of it, and back. */
function placeAt(time) {
  const k = moveAt(time);
  const seconds = story.times[k + 1] - story.times[k];
  return k + (seconds > 0 ? Math.min((time - story.times[k]) / seconds, 1) : 1);
}

function timeOf(place) {
  const k = Math.min(Math.floor(place), story.moves.length - 1);
  return story.times[k] + (place - k) * (story.times[k + 1] - story.times[k]);
}

/** What touches now, after what happens now. */
function sayContact() {
  const line = document.getElementById("now");
  line.classList.toggle("contact", contactShown !== null);
  if (contactShown) line.textContent += `. In collision: ${contactShown.text}`;
}

function pause() {
  playingSince = null;
  document.getElementById("play").textContent = "Play";
}

function goTo(time) {
  pause();
  show(time);
}

function play() {
  if (story.moves.length === 0) return;
  if (now >= total) show(0);
  playingSince = performance.now();
  document.getElementById("play").textContent = "Pause";
  requestAnimationFrame(tick);
}

function tick(stamp) {
  if (playingSince === null) return null;
  const seconds = Math.min(Math.max(stamp - playingSince, 0) / 1000, 0.25);
  playingSince = stamp;
  show(now + seconds * Number(document.getElementById("speed").value));
  const again = document.getElementById("loop").checked && !recording;
  if (now >= total && again) show(0);
  if (now < total) return requestAnimationFrame(tick);
  pause();
  return recording?.ended();
}

function step(direction) {
  const ahead = story.times.filter((time) => (direction > 0 ? time > now + 1e-6 : time < now - 1e-6));
  goTo(direction > 0 ? Math.min(...ahead, total) : Math.max(...ahead, 0));
}

/** The next speed of the list, or the one before. */
function changeSpeed(direction) {
  const list = document.getElementById("speed");
  list.selectedIndex = Math.min(Math.max(list.selectedIndex + direction, 0), list.options.length - 1);
}

function switchLoop() {
  const box = document.getElementById("loop");
  box.checked = !box.checked;
}

const ACTIONS = {  // of the player
  " ": () => (playingSince === null ? play() : pause()),
  ArrowRight: () => step(1),
  ArrowLeft: () => step(-1),
  Home: () => goTo(0),
  End: () => goTo(total),
  "+": () => changeSpeed(1),
  "-": () => changeSpeed(-1),
  l: switchLoop,
};
const VIEW_ACTIONS = { p: () => keepPicture(), ...Object.fromEntries(Object.keys(VIEWPOINTS).map((name, k) => [`${k + 1}`, () => lookFrom(name)])) };

/** Take over the moves and times of the story: bar, ticks, list of moves and labels. */
function newPath() {
  total = story.times.length ? story.times[story.times.length - 1] : 0;
  const player = document.getElementById("player");
  if (player.hidden) {
    player.hidden = false;
    document.getElementById("player-keys").hidden = false;
    viewer.set_3d_pane_size();
  }
  scrub.max = total;
  const hadSliders = document.getElementById("joints").classList.contains("still");
  if (story.moves.length && hadSliders) buildJoints();
  addTicks();
  if (!run && !story.timed) buildMoves(goTo);
  for (const control of [scrub, ...document.querySelectorAll("#buttons button")]) control.disabled = story.moves.length === 0;
  if (story.moves.length) show(Math.min(now, total));
  else showStill();
  labelPath();
}

/** The first posture, and nothing to play. */
function showStill() {
  pause();
  now = 0;
  setPosture(node("robot"), story.waypoints[0]);
  showJoints(story.waypoints[0], null, false);
  document.getElementById("now").textContent = trouble || "no path";
  showContact(0);
  sayContact();
}

/** The arm in a posture, which the sliders change from there. */
function standAt(posture) {
  const q = posture.slice();
  const pose = () => { setPosture(node("robot"), q); showJoints(q, null, false); };
  onJointMoved = (j, value) => { q[j] = value; pose(); };
  pose();
}

function addTicks() {
  const seconds = [...Array(Math.floor(total) + 1).keys()];
  const marked = story.timed ? seconds : run ? run.groups.filter((group) => group.event !== "walk").map((group) => story.times[group.first]) : story.times;
  const ticks = marked.length > 200 ? [] : marked.map((time) => {
    const tick = document.createElement("i");
    tick.style.left = `${(100 * time) / (total || 1)}%`;
    return tick;
  });
  document.getElementById("ticks").replaceChildren(...ticks, ...contactTicks(timeOf));
}

function addPlayer() {
  scrub.addEventListener("input", () => goTo(Number(scrub.value)));
  const buttons = { play: " ", forward: "ArrowRight", back: "ArrowLeft", first: "Home", last: "End" };
  for (const [id, action] of Object.entries(buttons)) {
    document.getElementById(id).addEventListener("click", ACTIONS[action]);
  }
  addEventListener("keydown", (event) => {
    const action = VIEW_ACTIONS[event.key] ?? (story.moves.length ? ACTIONS[event.key] : undefined);
    const typed = "select, textarea, input:not(#scrub, [type=checkbox])";
    const own = event.key === " " ? `${typed}, button, [type=checkbox]` : typed;  // what answers this key by itself
    if (!action || event.target.matches?.(own) || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    action();
  });
  addEventListener("click", (event) => {  // after a click with the mouse the space bar plays again
    if (event.detail > 0 && event.target.matches("button, [type=checkbox]")) event.target.blur();
  });
  addEventListener("hashchange", followAddress);
}

/** #waypoint=3 or #time=2.5 opens the page there, #view=Top looks from there. */
function followAddress() {
  const wanted = new URLSearchParams(location.hash.slice(1));
  const waypoint = Number(wanted.get("waypoint"));
  if (VIEWPOINTS[wanted.get("view")]) lookFrom(wanted.get("view"));
  if (story.moves.length === 0) return;
  if (wanted.has("waypoint") && story.times[waypoint] !== undefined) goTo(story.times[waypoint]);
  else goTo(Number(wanted.get("time")) || 0);
}

if (robot) {
  buildJoints();
  if (story.ghosts.length > 1) buildSolutions();
  addPlayer();
  sayProof(story.proof);
  if (story.moves.length) {
    if (run) buildEvents(goTo);
    if (story.clearance) showClearance = buildClearance(goTo);
    newPath();
  } else {
    standAt(story.ghosts.length ? story.ghosts[0].q : story.waypoints[0]);
    showContact(0);
  }
}
followAddress();
viewer.set_3d_pane_size();
document.documentElement.dataset.ready = "yes";
