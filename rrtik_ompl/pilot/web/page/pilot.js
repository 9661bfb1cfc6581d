// What is shown, and what the buttons do. All state is the server's; the page keeps only what it looks at.
"use strict";

const SPEEDS = [0.05, 0.1, 0.25, 0.5, 1];  // shares of the joints' rates
const COLOR_WORDS = { green: "reach", amber: "blocked", red: "no reach" };
const NEAR_LIMIT = 0.04, MARK = 0.006, UNSEEN_S = 1, HOLD_MS = 3000, SLOW_LINK_MS = 250;
const FIRST_WORDS = "Choose a grasp with G and L, then plan with P. Or choose a joint with 1 … 9 and hold ← or → to drive it.";
let state = null, role = { role: "watching", free: false, pages: 1 }, preset = 0, playing = null;
let previousAlert = "", heldUntil = 0, posture = -1;

const byId = (id) => document.getElementById(id);
const set = (element, text) => { if (element.textContent !== text) element.textContent = text; };
const make = (tag, attributes = {}, ...children) => {
  const element = Object.assign(document.createElement(tag), attributes);
  element.append(...children);
  return element;
};
const inWords = (text) => state.joints.reduce((said, { name }) => said.replaceAll(name, name.replaceAll("_", " ")), text);
const fixed = (value, digits = 1) => value.toFixed(digits).replace("-", "\u2212");

// --- commands ---------------------------------------------------------------------------------------------------

const inRadians = (value, unit) => unit === "m" ? value : value * Math.PI / 180;
function selectJoint(number) { if (state && number < state.joints.length) send("select", { joint: number }); }
function neighbourJoint(by) { selectJoint((state.selected + by + state.joints.length) % state.joints.length); }
function changeSpeed(by) {
  const now = SPEEDS.findIndex((speed) => speed >= state.speed - 1e-6);
  send("speed", { share: SPEEDS[Math.min(Math.max(now + by, 0), SPEEDS.length - 1)] });
}
function nextObject() {
  const names = state.objects.filter((each) => each.graspable).map((each) => each.name);
  if (names.length) send("object", { object: names[(names.indexOf(state.target) + 1) % names.length] });
}
function chooseGrasp(byType, byLevel) {
  const types = [...new Set(state.lamps.map((lamp) => lamp.type))];
  if (!types.length) return;
  const now = state.choice ? types.indexOf(state.choice.type) : byType ? -1 : 0;
  const type = types[(now + byType + types.length) % types.length];
  const levels = state.lamps.filter((lamp) => lamp.type === type).length;
  const level = state.choice ? state.choice.level + byLevel : 0;
  send("grasp", { type, level: level % levels });
}
function nextPosture() {
  posture = (posture + 1) % state.postures.length;
  send("posture", { object: state.postures[posture] });
}
function toggleGripper() { send(state?.gripper.closed ? "open" : "close"); }
function nextPreset() { preset = (preset + 1) % state.views.length; send("preset", { view: state.views[preset] }); }

// --- preview of the route ---------------------------------------------------------------------------------------

function showNow() { pausePlay(); send("play", { share: null }); }
function scrub(by) { preview((state.playing ?? 0) + by); }
function preview(share) {
  if (!state.route) { say("no route to preview; P plans one", "refusal"); return; }
  pausePlay();
  send("play", { share: Math.min(Math.max(share, 0), 1) });
}
function stepPreview(by) {
  if (!state.route) { preview(0); return; }
  const ends = [0, ...state.route.moves.map((move) => move.at)], now = state.playing ?? 0;
  const there = by > 0 ? ends.find((end) => end > now + 1e-6) : ends.findLast((end) => end < now - 1e-6);
  preview(there ?? (by > 0 ? 1 : 0));
}
function pausePlay() { clearInterval(playing); playing = null; byId("play").setAttribute("aria-pressed", "false"); }
function togglePlay() {
  if (playing) { pausePlay(); return; }
  if (!state.route) { preview(0); return; }
  let share = (state.playing ?? 1) >= 1 ? 0 : state.playing;
  const by = 0.06 / Math.min(Math.max(state.route.moves.length, 3), 20);
  byId("play").setAttribute("aria-pressed", "true");
  playing = setInterval(() => {
    share = Math.min(share + by, 1);
    if (!state.route || share >= 1) pausePlay();
    send("play", { share });
  }, 66);
}

// --- what the server says ---------------------------------------------------------------------------------------

function showRole(said) {
  role = said;
  const chip = byId("role"), pilot = said.role === "pilot";
  chip.className = `chip ${said.role}`;
  set(chip, pilot ? "You are the pilot" + (said.pages > 1 ? ` · ${said.pages - 1} watching` : "")
    : said.free ? "Watching · no pilot" : "Watching · another page is the pilot");
  byId("take").hidden = pilot || !said.free;
  byId("hand_over").hidden = !pilot || said.pages < 2;
}

function onDisconnected() {
  letAllGo();
  const chip = byId("role");
  chip.className = "chip bad";
  set(chip, "Not connected · trying again");
}

function showState(said) {
  const newRoute = Boolean(said.route) && said.mode === "proposed" && (!state || state.mode !== "proposed");
  const newMessage = !state || state.message !== said.message || state.level !== said.level;
  state = said;
  for (const item of byId("modes").children)
    item.dataset.mode === said.mode ? item.setAttribute("aria-current", "step") : item.removeAttribute("aria-current");
  if (newMessage || performance.now() > heldUntil) say(inWords(said.message) || FIRST_WORDS, said.level, 0);
  showJoints(); showTarget(); showPostures(); showLamps(); showRoute(); showAim(); showButtons(); showLatch(); showAlarms(); showGripper(); showViews(); showPreview(); showAge();
  if (said.mode !== "proposed" && playing) pausePlay();
  if (newRoute && role.role === "pilot" && !said.replay && !playing) togglePlay();
}

// `level`: "news", "refusal" of a command, or "alarm", which nobody has commanded.
function say(text, level = "news", hold = HOLD_MS) {
  heldUntil = performance.now() + hold;
  set(byId("message"), text);
  byId("message").className = level;
}

function alertOnce(text) {
  if (text !== previousAlert) set(byId("alerts"), text);
  previousAlert = text;
}

function showAge() {
  if (!state) return;
  const chip = byId("age"), age = pictureAge(), silent = (performance.now() - seenAt) / 1000;
  const past = state.replay || state.pictures_ended;  // photographs and films end: no reason for alarm
  const stale = !past && (age === null || age > STALE_S);
  document.body.classList.toggle("stale", stale);
  document.body.classList.toggle("untrue", stale || Boolean(state.trouble && state.trouble !== state.fault_of_arm));
  chip.classList.toggle("bad", stale);
  set(chip, state.replay ? state.camera_lost || (state.paused ? "record, paused" : "record")
    : state.pictures_ended ? "the last picture" : age === null ? "no picture yet" : stale ? `STALE picture: up to ${fixed(age)} s old` : `picture at most ${Math.round(1000 * age)} ms old`);
  chip.title = "from the camera to this screen, and until the arm can hear what you do";
  const reasons = [];
  if (state.camera_lost && !past) reasons.push(`Camera lost: ${state.camera_lost}. What is shown is the last known state.`);
  if (state.arm_lost) reasons.push(`${state.arm_lost}`);
  if (state.arm_fault) reasons.push(`${state.arm_fault}. It has to be mended there, and reset here.`);
  if (!reasons.length && silent > STALE_S && !past) reasons.push(`No news from the server for ${fixed(silent)} s. The arm stops where it hears nothing from this page.`);
  else if (!reasons.length && stale && age !== null) reasons.push(state.stale ? "The picture is stale: nothing moves." : `The picture comes late: it is up to ${fixed(age)} s old.`);
  if (state.unseen && !past) reasons.push(`${inWords(state.unseen)}: no route is led past it, and by hand it may be elsewhere.`);
  byId("camera_banner").hidden = !reasons.length;
  set(byId("camera_banner"), reasons.join(" "));
  alertOnce(reasons.join(" ").replaceAll(/\d+(\.\d+)? s\b/g, "some time"));  // said once, not each tenth of a second
  showLink();
}
setInterval(showAge, 100);

function showJoints() {
  const body = byId("joints").tBodies[0];
  if (body.children.length !== state.joints.length) body.replaceChildren(...state.joints.map(jointRow));
  state.joints.forEach((joint, k) => showJoint(body.children[k], joint, k));
  const { name, unit } = state.joints[state.selected];
  set(byId("step_size"), `${inWords(name)} · ${fixed(100 * state.speed, 0)} %`);
  set(byId("unit"), unit === "m" ? "m" : "°");
  showRoom(unit);
}

function showRoom(unit) {
  const range = state.range, at = (value) => fixed(value, unit === "m" ? 3 : 1) + (unit === "m" ? " m" : "°");
  const singular = range.singular.map(([from, to, name]) => `near singular${name && " "}${name} ${at(from)} to ${at(to)}`);
  const text = inWords(range.low === range.high ? `in contact, only out of it: ${range.below}`
    : [`free ${at(range.low)} (${range.below}) to ${at(range.high)} (${range.above})`, ...singular].join(" · "));
  set(byId("range"), text);
  byId("range").title = text;
}

function jointRow(joint, k) {
  const bar = make("div", { className: "bar" }, ...["free", "singular", "way", "wanted", "is"].map((name) => make("i", { className: name })));
  bar.setAttribute("role", "meter");
  bar.onclick = (event) => driveTo(k, event);
  bar.title = "click: wanted value; hold Enter to drive there";
  const row = make("tr", { onclick: () => selectJoint(k) },
    make("th", { scope: "row" }, `${k + 1} ${joint.name.replaceAll("_", " ")}`),
    make("td", {}, bar), make("td"), make("td"), make("td"));
  return row;
}

function driveTo(k, event) {
  const joint = state.joints[k], box = event.currentTarget.getBoundingClientRect();
  event.stopPropagation();
  selectJoint(k);
  if (joint.lower === null) return;
  const value = joint.lower + (event.clientX - box.left) / box.width * (joint.upper - joint.lower);
  send("move", { target: inRadians(value, joint.unit) });
}

function showJoint(row, joint, k) {
  const bar = row.cells[1].firstChild, [free, singular, way, wanted, is] = bar.children, digits = joint.unit === "m" ? 3 : 1;
  if (k === state.selected && row.getAttribute("aria-selected") !== "true") row.scrollIntoView({ block: "nearest" });
  row.setAttribute("aria-selected", String(k === state.selected));
  const share = (value) => joint.lower === null ? 0.5 + (((value % 360) + 540) % 360 - 180) / 360
    : Math.min(Math.max((value - joint.lower) / (joint.upper - joint.lower), 0), 1);
  const now = share(joint.value), goal = share(joint.desired), percent = (part) => `${100 * part}%`;
  is.style.left = percent(now);
  wanted.style.left = percent(goal);
  way.style.left = percent(Math.min(now, goal));
  way.style.width = percent(Math.abs(goal - now));
  free.hidden = singular.hidden = k !== state.selected || joint.lower === null;
  if (!free.hidden) {
    const { low, high, singular: stretches } = state.range;
    free.style.left = percent(share(low));
    free.style.width = percent(share(high) - share(low));
    const marks = stretches.map(([from, to]) => [percent(share(from) - MARK), percent(share(to) + MARK)]);
    singular.style.background = marks.length ? `linear-gradient(to right, ${marks.map(([from, to]) =>
      `transparent ${from}, var(--amber) ${from} ${to}, transparent ${to}`).join()})` : "none";
  }
  bar.classList.toggle("near", joint.lower !== null && (now < NEAR_LIMIT || now > 1 - NEAR_LIMIT));
  const difference = joint.desired - joint.value, small = Math.abs(difference) < (joint.unit === "m" ? 0.0005 : 0.05);
  set(row.cells[2], `${fixed(joint.value, digits)} ${joint.unit === "m" ? "m" : "°"}`);
  set(row.cells[3], fixed(joint.desired, digits));
  set(row.cells[4], (small ? "✓ " : "") + fixed(difference, digits));
  row.cells[4].className = small ? "there" : "off";
  const limits = joint.lower === null ? "endless" : `limits ${fixed(joint.lower)} to ${fixed(joint.upper)}`;
  bar.setAttribute("aria-label", `${joint.name}, ${limits}`);
  bar.setAttribute("aria-valuetext", `${fixed(joint.value, digits)}, wanted ${fixed(joint.desired, digits)} ${joint.unit === "m" ? "metres" : "degrees"}`);
  for (const [name, value] of [["valuenow", joint.value], ["valuemin", joint.lower ?? -180], ["valuemax", joint.upper ?? 180]])
    bar.setAttribute(`aria-${name}`, value.toFixed(digits));
}

function showTarget() {
  const list = byId("target"), names = state.objects.filter((each) => each.graspable).map((each) => each.name);
  if ([...list.options].map((option) => option.value).join() !== names.join())
    list.replaceChildren(...names.map((name) => make("option", { value: name }, name)));
  if (state.target && list.value !== state.target) list.value = state.target;
}

const KEEP = "keep this (E)";

function showPostures() {
  const list = byId("posture"), key = state.postures.join();
  if (list.dataset.key === key) return;
  list.dataset.key = key;
  list.replaceChildren(make("option", { value: "", hidden: true }, "Pose W"),
    ...[...state.postures, KEEP].map((name) => make("option", { value: name }, name.replaceAll("_", " "))));
}

function showLamps() {
  const table = byId("lamps"), types = [...new Set(state.lamps.map((lamp) => lamp.type))];
  const most = Math.max(0, ...types.map((type) => state.lamps.filter((lamp) => lamp.type === type).length));
  const key = JSON.stringify(state.lamps.map((lamp) => [lamp.type, lamp.level]));
  if (table.dataset.key !== key) {
    table.dataset.key = key;
    const head = make("tr", {}, make("th", { scope: "col" }, "type"), ...Array.from({ length: most }, (_, k) => make("th", { scope: "col" }, `level ${k + 1}`)));
    table.replaceChildren(head, ...types.map((type) => make("tr", {}, make("th", { scope: "row" }, type),
      ...state.lamps.filter((lamp) => lamp.type === type).map((lamp) => make("td", {}, lampButton(lamp))))));
  }
  for (const lamp of state.lamps) {
    const button = byId(`lamp_${lamp.type}_${lamp.level}`);
    const chosen = Boolean(state.choice) && state.choice.type === lamp.type && state.choice.level === lamp.level;
    button.dataset.color = lamp.color;
    button.setAttribute("aria-pressed", String(chosen));
    button.setAttribute("aria-label", `${lamp.type} level ${lamp.level + 1}: ${COLOR_WORDS[lamp.color]}${lamp.reason ? ", " + lamp.reason : ""}`);
    button.title = lamp.reason || "approach, grasp and lift can be reached";
    set(button.lastChild, COLOR_WORDS[lamp.color]);
  }
  const lamp = state.choice && state.lamps.find((each) => each.type === state.choice.type && each.level === state.choice.level);
  const words = !state.lamps.length ? state.hint || "No object with grasps in view."
    : !lamp ? "Choose with G (type) and L (level)."
    : `${lamp.type} level ${lamp.level + 1}: ${state.fault || "approach, grasp and lift can be reached"}`;
  set(byId("reason"), shortened(inWords(words)));
  byId("reason").title = inWords(words);
}

// In two lines: degrees to a tenth, and what joint is beyond its limits without "the arm could reach the goal, but".
function shortened(words) {
  return words.replace(/grasp: the arm could reach the goal, but joint '([^']*)' is/, "$1")
    .replaceAll(/(-?\d+\.\d)\d+/g, "$1").replaceAll(" deg", "\u00b0");
}

function lampButton(lamp) {
  return make("button", { className: "lamp", id: `lamp_${lamp.type}_${lamp.level}`, onclick: () => send("grasp", { type: lamp.type, level: lamp.level }) },
    make("span", { className: "shape" }), make("span"));
}

function showRoute() {
  const list = byId("moves"), route = state.route;
  byId("current").hidden = !route || state.mode !== "following";
  byId("withdrawn").hidden = !route?.withdrawn;
  set(byId("withdrawn"), route?.withdrawn ? inWords(`WITHDRAWN: ${route.withdrawn}. Nothing moves on it.`) : "");
  list.classList.toggle("withdrawn", Boolean(route?.withdrawn));
  if (!route) { if (list.children.length) list.replaceChildren(); list.dataset.key = ""; set(byId("route_numbers"), ""); return; }
  const clear = route.clearance_mm === null ? "" : ` · ${fixed(route.clearance_mm, 0)} mm clear`;
  set(byId("route_numbers"), `${route.moves.length} · ${fixed(route.travel, 0)}° · ${fixed(route.seconds, 0)} s${clear} · ${fixed(100 * route.robustness, 0)} % safe at ±1°`);
  byId("route_numbers").title = `joints: ${route.joints.join(", ").replaceAll("_", " ")}`;
  const key = JSON.stringify(route.moves.map((move) => move.text));
  if (list.dataset.key !== key) { list.dataset.key = key; list.replaceChildren(...route.moves.map((move) => make("li", { ariaLabel: move.text }, inShort(move)))); list.scrollTop = 0; }
  route.moves.forEach((move, k) => {
    const item = list.children[k], now = state.mode === "following" && move.status === "current";
    const name = `${now ? "current" : move.status === "done" ? "done" : ""}${k >= route.grasp_from ? " grasp" : ""}`.trim();
    if (item.className === name) return;
    item.className = name;
    if (now) { item.setAttribute("aria-current", "step"); item.scrollIntoView({ block: "nearest" }); } else item.removeAttribute("aria-current");
  });
  const words = { move: state.driving ? "MOVING" : "NEXT", stop: state.driving ? "ENDING" : "NEXT", lost: "OFF ROUTE", done: "DONE" };
  const due = route.moves.find((move) => move.status === "current");
  byId("advice").className = route.advice;
  set(byId("advice"), words[route.advice] ?? "");
  set(byId("due"), due ? inShort(due) : "");
  byId("together").setAttribute("aria-pressed", String(Boolean(route.together)));
  byId("progress").value = route.share;
}

function inShort(move) {
  if (!move.unit) return move.text;
  const digits = move.unit === "m" ? 3 : 1, sign = move.unit === "m" ? " m" : "°";
  return `${move.joint.replaceAll("_", " ")} ${move.to > move.from ? "▲" : "▼"} ${fixed(Math.abs(move.to - move.from), digits)}${sign} to ${fixed(move.to, digits)}${sign}`;
}

const isOutOfView = (seen) => !state.replay && seen.unseen > UNSEEN_S;

function showAim() {
  const aim = state.aim, metres = (value) => `${fixed(Math.abs(value), 3)} m`;
  const rows = [["tip x, y, z [m]", aim.tip.map((value) => fixed(value, 2)).join("  ")]];
  if (aim.to) rows.push([`to ${aim.to}`, metres(aim.distance)], [aim.ahead < 0 ? "behind the tool" : "ahead of the tool", metres(aim.ahead)],
    ["aside of its axis", metres(aim.aside)], [aim.xyz[2] < 0 ? "lower" : "higher", metres(aim.xyz[2])], ["turned away by", `${fixed(aim.turn_deg)}°`]);
  const { nearest, to_target: edges } = state.aids, gap = (pair) => inWords(`${pair.first} – ${pair.second}`);
  if (nearest) rows.push([gap(nearest), `${fixed(nearest.mm, 0)} mm`]);
  if (edges && aim.to) rows.push(["gripper to its edges", `${fixed(edges.mm, 0)} mm`]);
  for (const each of state.arm_health) rows.push([`arm: ${each.name}${each.ok ? "" : " ⚠"}`, `${fixed(each.value)} ${each.unit}`]);
  for (const seen of state.objects) rows.push([`${seen.name} seen to within`, `± ${fixed(seen.sigma_mm, 2)} mm`]);
  for (const gone of state.objects.filter(isOutOfView)) rows.push([`${gone.name} not in view for`, `${fixed(gone.unseen, 0)} s`]);
  const list = byId("depth"), key = rows.map((row) => row[0]).join();
  if (list.dataset.key !== key) { list.dataset.key = key; list.replaceChildren(...rows.flatMap(([name]) => [make("dt", {}, name), make("dd")])); }
  rows.forEach(([, value], k) => set(list.children[2 * k + 1], value));
  const target = state.objects.find((each) => each.name === state.target);
  const unseen = target && isOutOfView(target) ? `not in view for ${fixed(target.unseen, 0)} s\n` : "";
  byId("numbers").classList.toggle("unseen", Boolean(unseen));
  set(byId("numbers"), aim.to ? `${unseen}${aim.to}\n${metres(aim.distance)} away\n${metres(aim.ahead)} ${aim.ahead < 0 ? "behind" : "ahead"}\n${metres(aim.aside)} aside` : "");
}

function showButtons() {
  byId("pause").hidden = !state.replay || role.role !== "pilot";
  set(byId("pause").firstChild, state.paused ? "Go on" : "Pause");
  const mine = role.role === "pilot" && !state.replay && !state.trouble && !state.stopped, at = (...modes) => mine && modes.includes(state.mode);
  const led = mine && !state.unseen;
  for (const [id, good] of [["accept", at("proposed") && !state.route?.withdrawn], ["reject", role.role === "pilot" && state.mode === "proposed"], ["next", at("following")], ["plan", led],
    ["together", led && at("proposed")], ["servo", led && at("manoeuvre", "choosing", "proposed") && Boolean(state.choice)], ["posture", led && state.mode !== "following"], ["replan", led && Boolean(state.route)], ["back", led && Boolean(state.route)], ["stop", !state.replay],
    ...["minus", "plus", "go", "tool_in", "tool_out"].map((id) => [id, at("manoeuvre", "choosing", "proposed")])]) byId(id).disabled = !good;
  for (const id of ["play", "step_back", "step_on", "scrub", "live"]) byId(id).disabled = role.role !== "pilot" || state.mode !== "proposed";
}

const isLatched = () => state.stopped || Boolean(state.fault_of_arm);

function showLatch() {
  byId("latch").hidden = !isLatched();
  byId("reset").hidden = !isLatched() || role.role !== "pilot" || state.replay;
}

// The list is the server's, so that a page which comes later has it, too; which of them were read is the page's.
let alarmsRead = null;  // time of the newest one

function showAlarms() {
  const list = byId("alarms"), button = byId("alarms_open"), count = state.alarms.length;
  const newest = count ? state.alarms[count - 1].at : null;
  if (!list.hidden) alarmsRead = newest;
  button.hidden = !count;
  button.classList.toggle("bad", newest !== alarmsRead);
  set(button.firstChild, count === 1 ? "1 alarm" : `${count} alarms`);
  const lines = state.alarms.map(({ age, text }) => `${new Date(Date.now() - 1000 * age).toTimeString().slice(0, 8)}  ${inWords(text)}`).reverse();
  if (list.children.length !== count) list.replaceChildren(...lines.map(() => make("li")));
  if (!list.hidden) lines.forEach((line, k) => set(list.children[k], line));
}

function toggleAlarms() {
  if (!state?.alarms.length) return;
  byId("alarms").hidden = !byId("alarms").hidden;
  byId("alarms_open").setAttribute("aria-expanded", String(!byId("alarms").hidden));
  showAlarms();
}
byId("alarms_open").onclick = toggleAlarms;

function showGripper() {
  const { closed, holds } = state.gripper;
  set(byId("grip").firstChild, closed ? "Open gripper" : "Close gripper");
  byId("grip").setAttribute("aria-pressed", String(closed));
  set(byId("holds"), holds ? `holds ${holds}` : closed ? "closed, empty" : "open");
  const free = role.role === "pilot" && !state.replay && !state.trouble && !state.stopped && state.mode !== "following";
  byId("grip").disabled = !free;
  byId("lift").disabled = !free || !holds || Boolean(state.unseen);
}

function showViews() {
  const row = byId("presets"), key = state.views.join();
  if (row.dataset.key !== key) {
    row.dataset.key = key;
    row.replaceChildren(...state.views.map((name, k) => make("button", { onclick: () => { preset = k; send("preset", { view: name }); } }, name)));
  }
  set(byId("outside_tag"), state.view ? `Camera: ${state.view}` : "From outside");
}

function showLink() {
  const ms = window.measured.link = lineTime();
  byId("link").hidden = ms === null;
  byId("link").classList.toggle("bad", ms > SLOW_LINK_MS);
  set(byId("link"), `link ${Math.round(ms)} ms`);
}

function showPreview() {
  const previewed = state.playing !== null && Boolean(state.route);
  byId("preview_tag").hidden = !previewed || Boolean(state.view);
  byId("outside_panel").classList.toggle("previewed", previewed && !state.view);
  if (document.activeElement !== byId("scrub")) byId("scrub").value = state.playing ?? 0;
}

// --- buttons, mouse ---------------------------------------------------------------------------------------------

for (const name of ["plan", "replan", "accept", "reject", "back", "take", "hand_over", "pause", "reset"]) byId(name).onclick = () => send(name);
byId("grip").onclick = toggleGripper;
byId("lift").onclick = () => send("lift");
byId("stop").onpointerdown = stopNow;
byId("stop").onclick = stopNow;
holdButton(byId("next"), () => ["next", {}]);
holdButton(byId("servo"), () => ["servo", {}]);
byId("together").onclick = () => send("together");
holdButton(byId("go"), () => ["go", {}]);
holdButton(byId("tool_in"), () => ["tool", { direction: 1 }]);
holdButton(byId("tool_out"), () => ["tool", { direction: -1 }]);
holdButton(byId("minus"), () => ["jog", { direction: -1 }]);
holdButton(byId("plus"), () => ["jog", { direction: 1 }]);
byId("value").onkeydown = (event) => {
  const typed = event.target.valueAsNumber;
  if (event.key !== "Enter" && event.key !== "Escape") return;
  event.stopPropagation();  // it is another press of Enter that drives
  if (event.key === "Enter" && Number.isFinite(typed)) send("move", { target: inRadians(typed, state.joints[state.selected].unit) });
  else if (event.key === "Enter") say("type a number for the joint, for example -20", "refusal");
  event.target.value = "";
  event.target.blur();
};
byId("target").onchange = (event) => { send("object", { object: event.target.value }); event.target.blur(); };
byId("posture").onchange = (event) => {
  const name = event.target.value;
  if (name === KEEP) send("keep"); else send("posture", { object: name });
  event.target.value = "";
  event.target.blur();
};
byId("play").onclick = togglePlay;
byId("live").onclick = showNow;
byId("step_back").onclick = () => stepPreview(-1);
byId("step_on").onclick = () => stepPreview(1);
byId("scrub").oninput = (event) => preview(Number(event.target.value));
byId("scrub").onpointerup = (event) => event.target.blur();  // whoever drags goes on with the arrow keys as before

const dragged = { right: 0, up: 0 };
byId("outside").onpointerdown = (event) => event.target.setPointerCapture(event.pointerId);
byId("outside").onpointermove = (event) => {
  if (!event.buttons) return;
  dragged.right += 0.008 * event.movementX;
  dragged.up += 0.008 * event.movementY;
};
byId("outside").addEventListener("wheel", (event) => {
  event.preventDefault();
  send("zoom", { factor: event.deltaY > 0 ? 1.1 : 0.91 });
}, { passive: false });
setInterval(() => {
  if (!dragged.right && !dragged.up) return;
  send("turn", { ...dragged });
  dragged.right = dragged.up = 0;
}, 40);

connect();
