// Hold to run: a command is sent again and again while its key, button or stick is held, and "release" when it is let go.
// The server moves the arm no farther than the last of them allows: whatever hangs or is lost, the arm stops.
"use strict";

const HOLD_PERIOD_MS = 40;
let held = null, press = Math.floor(Math.random() * 500000);
let padArmed = false;  // the gamepad has passed neutral since it was plugged in, or anything was lost

// `make` gives the command: its name and values, or null to let go.
function hold(source, make) {
  if (held) return;
  press += 1;
  held = { source, make, press };
  held.timer = setInterval(renew, HOLD_PERIOD_MS);
  renew();
}
function renew() {
  const made = held.make();
  if (made) send(made[0], { ...made[1], press: held.press }); else letGo();
}
function letGo(source) {
  if (!held || (source !== undefined && held.source !== source)) return;
  clearInterval(held.timer);
  held = null;
  send("release");
}


// Everything is let go, and whoever drives by a gamepad begins at neutral again.
function letAllGo() { padArmed = false; letGo(); }

addEventListener("blur", letAllGo);
document.addEventListener("visibilitychange", () => { if (document.hidden) letAllGo(); });

// A button that acts while it is held, by mouse or finger.
function holdButton(button, make) {
  button.onpointerdown = (event) => { button.setPointerCapture(event.pointerId); hold(button, make); };
  for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) button.addEventListener(end, () => letGo(button));
  button.oncontextmenu = () => false;
}

// A button that was clicked by mouse or finger gives the keys back: the next Enter is no second click.
addEventListener("click", (event) => { if (event.detail > 0) event.target.closest?.("button")?.blur(); });
