// The connection: pictures and states in, commands out. It comes back by itself; the session goes on meanwhile.
"use strict";

const RECONNECT_MS = 700, STALE_S = 0.5, DECODE_MS = 1000;
const token = new URLSearchParams(location.search).get("token") || "";
const pageName = sessionStorage.getItem("rrtik-page") || crypto.randomUUID?.() || String(Math.random());
sessionStorage.setItem("rrtik-page", pageName);

let socket = null, sequence = 0, me = 0;
const sent = new Map();  // sequence -> when, for the time from a key to what it changed
window.measured = { answers: [], states: 0, frames: { C: 0, O: 0 } };

// How old what is shown is, without a clock that both sides share: states and pictures have the server's stamps [s], the
// page sends back those that it has shown, and the server says which has come back last.
const echoed = new Map();  // stamp of a state -> when it was sent back
let seen = null, seenAt = 0, picture = null;  // stamps of the last state, when it came, and of the last picture
let heardAt = null;  // when the last echo that the server has heard was sent
let roundTrip = null;  // [ms], of that echo

function connect() {
  const query = new URLSearchParams({ page: pageName, token });
  socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/ws?${query}`);
  socket.binaryType = "arraybuffer";
  socket.onmessage = (event) => typeof event.data === "string" ? onText(JSON.parse(event.data)) : onFrame(event.data);
  socket.onclose = () => { forget(); onDisconnected(); setTimeout(connect, RECONNECT_MS); };
}

function send(name, values = {}) {
  if (!socket || socket.readyState !== WebSocket.OPEN) return;
  sequence += 1;
  sent.set(sequence, performance.now());
  socket.send(JSON.stringify({ name, seq: sequence, seen, picture, ...values }));
}

function shown(what, stamp) {
  if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ shown: what, stamp }));
}

function forget() {
  echoed.clear();
  seen = picture = heardAt = roundTrip = null;
}

function noteState(said) {
  const now = performance.now(), heard = said.heard[me];
  seen = said.stamp;
  seenAt = now;
  if (echoed.has(heard)) {
    heardAt = echoed.get(heard);
    roundTrip = now - heardAt;
    for (const stamp of [...echoed.keys()]) if (stamp < heard) echoed.delete(stamp);
  }
  if (!echoed.has(seen)) echoed.set(seen, now);
}

// How long the line takes to the server and back [ms], or for how long nothing has come if that is more.
const lineTime = () => roundTrip === null ? null : Math.max(roundTrip, performance.now() - seenAt);

// How old the picture is at most [s]. The server's clock was not yet at `seen` when the echo left that it had heard then.
const pictureAge = () => picture === null || heardAt === null ? null : seen - picture + (performance.now() - heardAt) / 1000;

function onText(said) {
  if (said.kind === "state") {
    noteState(said);
    showState(said);
    shown("state", said.stamp);
    window.measured.states += 1;
    measureAnswer(said.answered[me]);
  } else if (said.kind === "role") { me = said.you; showRole(said); }
  else if (said.kind === "title") { document.title = said.title; byId("title").textContent = said.title; }
  else if (said.kind === "refused") say(said.text, "refusal");
}

function measureAnswer(number) {
  if (!sent.has(number)) return;
  const begin = sent.get(number);
  requestAnimationFrame(() => window.measured.answers.push(performance.now() - begin));
  if (window.measured.answers.length > 500) window.measured.answers.shift();
  for (const old of [...sent.keys()]) if (old <= number) sent.delete(old);
}

const CANVASES = { C: "camera", O: "outside" };

// A picture that hangs in the browser's decoder does not hold up those that come after it: the server sends no more than
// two that were not answered.
async function onFrame(data, line = socket) {
  const kind = String.fromCharCode(new Uint8Array(data, 0, 1)[0]), taken = new DataView(data).getFloat64(1, true);
  const stamp = Number.isFinite(taken) ? taken : null;  // there may be no picture yet
  let answered = false;
  const answer = () => { if (!answered && line === socket) shown("frame"); answered = true; };
  const patience = setTimeout(answer, DECODE_MS);
  try {
    const image = await createImageBitmap(new Blob([new Uint8Array(data, 9)], { type: "image/jpeg" }));
    if (line === socket && (kind !== "C" || picture === null || stamp >= picture)) draw(kind, stamp, image);
    image.close();
  } finally { clearTimeout(patience); answer(); }
}

function draw(kind, stamp, image) {
  const canvas = byId(CANVASES[kind]);
  if (canvas.width !== image.width) { canvas.width = image.width; canvas.height = image.height; }
  canvas.getContext("2d").drawImage(image, 0, 0);
  if (kind === "C") picture = stamp;
  window.measured.frames[kind] += 1;
}
