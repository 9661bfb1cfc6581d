// Every key with what it does. The help overlay is made of this list, so that it never says anything else.
// A key with a fifth entry acts while it is held; the entry gives the command.
"use strict";

const KEYS = [
  ["Space", [], "stop at once (every page may)", null],
  ["Backspace", ["Backspace"], "let the arm be driven again after STOP, or after it went wrong", () => send("reset")],
  ["1 … 9", [..."123456789"], "select a joint", (key) => selectJoint(Number(key) - 1)],
  ["↑ ↓", ["ArrowUp", "ArrowDown"], "previous, next joint", (key) => neighbourJoint(key === "ArrowUp" ? -1 : 1)],
  ["← →", ["ArrowLeft", "ArrowRight"], "hold: drive the joint", null, (key) => ["jog", { direction: key === "ArrowLeft" ? -1 : 1 }]],
  ["M", ["m"], "type a value for the joint", () => byId("value").select()],
  ["Enter", ["Enter"], "hold: drive the joint to that value", null, () => ["go", {}]],
  [", .", [",", "."], "slower, faster", (key) => changeSpeed(key === "," ? -1 : 1)],
  ["O", ["o"], "next object", () => nextObject()],
  ["G", ["g"], "next grasp type", () => chooseGrasp(1, 0)],
  ["L", ["l"], "next grasp level", () => chooseGrasp(0, 1)],
  ["P", ["p"], "plan a route", () => send("plan")],
  ["A", ["a"], "accept the route", () => send("accept")],
  ["R", ["r"], "reject the route", () => send("reject")],
  ["N", ["n"], "hold: make the next move", null, () => ["next", {}]],
  ["J", ["j"], "the route with all joints at once, or as a list", () => send("together")],
  ["F", ["f"], "hold: the last centimetres to the grasp, by sight", null, () => ["servo", {}]],
  ["D S", ["d", "s"], "hold: the tool forward along its axis, back", null, (key) => ["tool", { direction: key === "d" ? 1 : -1 }]],
  ["K", ["k"], "hold: follow the master arm", null, () => ["lead", {}]],
  ["W", ["w"], "plan a route to the next posture: stowed, as at the begin, ...", () => nextPosture()],
  ["E", ["e"], "keep this posture", () => send("keep")],
  ["B", ["b"], "plan the way back", () => send("back")],
  ["Y", ["y"], "plan anew from where the arm is", () => send("replan")],
  ["C", ["c"], "close the gripper, or open it", () => toggleGripper()],
  ["U", ["u"], "plan the way up with what is held", () => send("lift")],
  ["X", ["x"], "play the route in the outside view", () => togglePlay()],
  ["[ ]", ["[", "]"], "scrub back, on", (key) => scrub(key === "[" ? -0.02 : 0.02)],
  ["PgUp PgDn", ["PageUp", "PageDown"], "preview one move back, on", (key) => stepPreview(key === "PageUp" ? -1 : 1)],
  ["0", ["0"], "show the arm as it is now", () => showNow()],
  ["Shift ← → ↑ ↓", [], "turn the outside view", null],
  ["+ −", ["+", "=", "-"], "nearer, farther", (key) => send("zoom", { factor: key === "-" ? 1.1 : 0.91 })],
  ["V", ["v"], "look from the next side", () => nextPreset()],
  ["T", ["t"], "take over, when no pilot is there", () => send("take")],
  ["H", ["h"], "hand over to a page that watches", () => send("hand_over")],
  ["Q", ["q"], "the alarms and when they were", () => toggleAlarms()],
  ["Z", ["z"], "pause a record", () => send("pause")],
  ["?", ["?"], "these keys", () => toggleHelp()],
];
const ACTIONS = new Map(KEYS.flatMap(([, keys, , act]) => (act ? keys : []).map((key) => [key, act])));
const HELD = new Map(KEYS.filter((entry) => entry[4]).flatMap(([, keys, , , make]) => keys.map((key) => [key, make])));
const LOOKING = new Set(["q", "v", "+", "=", "-", "x", "[", "]", "PageUp", "PageDown", "0"]);  // while a key is held
const TURNS = { ArrowLeft: [-0.12, 0], ArrowRight: [0.12, 0], ArrowUp: [0, 0.08], ArrowDown: [0, -0.08] };
const SCRUBBING = new Set(["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown", "Home", "End", "PageUp", "PageDown"]);
const REPEATED = new Set(["[", "]", "+", "=", "-"]);

const help = document.getElementById("help");

// The list is no modal dialog, under which STOP would be dead: instead everything but the list and STOP is.
function toggleHelp() {
  letAllGo();
  if (help.open) help.close(); else help.show();
  document.body.classList.toggle("listing", help.open);
}
for (const kind of ["pointerdown", "click", "wheel"]) addEventListener(kind, (event) => {
  if (!help.open || event.target.closest("#help, #stop")) return;
  event.preventDefault();
  event.stopImmediatePropagation();
}, { capture: true, passive: false });

// Space stops, whatever is open or focused, and with any modifier; its button hears nothing of it.
function onSpace(event) {
  if (event.key !== " " && event.code !== "Space") return;
  event.preventDefault();
  event.stopImmediatePropagation();
  if (event.type === "keydown" && !event.repeat) stopNow();
}
addEventListener("keydown", onSpace, { capture: true });
addEventListener("keyup", onSpace, { capture: true });

// What is focused keeps the keys that it cannot do without; all others command, wherever the mouse has been.
function needsKey(element, key) {
  return element.matches("select, input[type=number]") || (element.matches("input[type=range]") && SCRUBBING.has(key));
}

function onKey(event) {
  if (help.open) { onKeyInHelp(event); return; }
  if (event.ctrlKey || event.altKey || event.metaKey || needsKey(event.target, event.key)) return;
  if (event.key === "Enter" && event.target.matches("button")) {
    if (event.repeat) event.preventDefault();  // a key that is held down clicks once
    return;
  }
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  const turn = event.shiftKey && TURNS[key];
  if (!turn && HELD.has(key)) {
    event.preventDefault();
    if (!event.repeat) hold(key, () => HELD.get(key)(key));
    return;
  }
  const act = turn ? () => send("turn", { right: turn[0], up: turn[1] }) : ACTIONS.get(key);
  if (!act || (event.repeat && !turn && !REPEATED.has(key))) return;
  event.preventDefault();
  if (!turn && !LOOKING.has(key)) letGo();
  act(key);
}

function onKeyInHelp(event) {
  if (event.key === "Escape" || event.key === "?") toggleHelp();
  else if (event.key === "Tab" || (event.key === "Enter" && event.repeat)) event.preventDefault();  // stay on "Close"
}

function stopNow() { letAllGo(); send("stop"); }

addEventListener("keydown", onKey);
addEventListener("keyup", (event) => letGo(event.key.length === 1 ? event.key.toLowerCase() : event.key));
document.getElementById("key_list").replaceChildren(...KEYS.map(([shown, , what]) => {
  const line = document.createElement("div"), key = document.createElement("kbd");
  key.textContent = shown;
  line.append(what, key);
  return line;
}));
document.getElementById("help_open").onclick = toggleHelp;
document.getElementById("help_close").onclick = toggleHelp;
