// A gamepad of the browser's Gamepad API, in its standard layout. It acts only while its left shoulder button is held.
"use strict";

const PAD_PERIOD_MS = 40, DEAD_ZONE = 0.15;
const ENABLE = 4, STOP_BUTTON = 1;
const PAD_HELD = new Map([[0, () => ["next", {}]], [5, () => ["go", {}]], [7, () => ["servo", {}]]]);
const PAD_TAPPED = new Map([
  [2, () => send("plan")], [3, () => send("accept")], [8, () => send("reject")], [9, () => nextObject()],
  [6, () => chooseGrasp(1, 0)], [7, () => chooseGrasp(0, 1)], [12, () => neighbourJoint(-1)],
  [11, () => send("lift")], [13, () => neighbourJoint(1)], [14, () => changeSpeed(-1)], [15, () => changeSpeed(1)],
]);
const PAD_ENABLED = new Map([  // only while the shoulder button is held, too
  [9, () => (isLatched() ? send("reset") : nextObject())], [10, () => toggleGripper()],
]);
const PAD_WORDS = "gamepad: LB held enables · left stick drives the joint · right stick up, down: the tool along its axis · A held: next move · B: STOP · X plan · Y accept · "
  + "RB held: joint to its value · RT held with LB: the last centimetres by sight · D-pad: joint, speed · LT type · "
  + "RT without LB: level · left stick pressed: gripper · Start with LB: reset after STOP · right stick pressed: lift";
let padBefore = [], padWasThere = false;

const NEUTRAL_WORDS = "gamepad: let the stick go, then press LB anew";

const firstPad = () => [...(navigator.getGamepads?.() ?? [])].find((pad) => pad && pad.connected && pad.mapping === "standard");
const isDown = (pad, number) => Boolean(pad && pad.buttons[number]?.pressed);

function stick() {
  const pad = firstPad(), pushed = pad && padArmed && isDown(pad, ENABLE) ? pad.axes[0] : 0, size = Math.abs(pushed);
  return size < DEAD_ZONE ? null : ["jog", { direction: Math.sign(pushed) * Math.min((size - DEAD_ZONE) / (1 - DEAD_ZONE), 1) }];
}

// The right stick, up and down, moves the tool along its axis.
function toolStick() {
  const pad = firstPad(), pushed = pad && padArmed && isDown(pad, ENABLE) ? -pad.axes[3] : 0, size = Math.abs(pushed);
  return size < DEAD_ZONE ? null : ["tool", { direction: Math.sign(pushed) * Math.min((size - DEAD_ZONE) / (1 - DEAD_ZONE), 1) }];
}

function readPad() {
  const pad = firstPad();
  if (padWasThere !== Boolean(pad)) showPad(Boolean(pad));
  if (!pad) { if (padBefore.length) letAllGo(); padBefore = []; return; }
  const now = pad.buttons.map((button) => button.pressed), tapped = (number) => now[number] && !padBefore[number];
  if (tapped(STOP_BUTTON)) stopNow();
  arm(pad, now);
  for (const [number, make] of PAD_HELD) {
    if (tapped(number) && now[ENABLE] && padArmed) hold(`pad ${number}`, () => padArmed && isDown(firstPad(), ENABLE) && isDown(firstPad(), number) ? make() : null);
    if (!now[number]) letGo(`pad ${number}`);
  }
  for (const [number, act] of PAD_TAPPED) if (tapped(number) && state && !(now[ENABLE] && (PAD_HELD.has(number) || PAD_ENABLED.has(number)))) { letGo(); act(); }
  for (const [number, act] of PAD_ENABLED) if (tapped(number) && now[ENABLE] && state) { letGo(); act(); }
  if (stick()) hold("stick", stick); else letGo("stick");
  if (toolStick()) hold("tool stick", toolStick); else letGo("tool stick");
  padBefore = now;
}

// As of every enabling device: it has to be pressed anew, and with the stick at rest, before it enables anything.
function arm(pad, now) {
  if (!now[ENABLE]) padArmed = false;
  else if (padBefore.length && !padBefore[ENABLE]) {
    padArmed = [0, 3].every((axis) => Math.abs(pad.axes[axis]) < DEAD_ZONE);
    if (!padArmed) say(NEUTRAL_WORDS, "refusal");
  }
}

function showPad(there) {
  padWasThere = there;
  byId("pad").hidden = !there;
  byId("pad").title = PAD_WORDS;
  if (!there) say("the gamepad is gone: nothing is driven by it", "alarm");
}
setInterval(readPad, PAD_PERIOD_MS);
