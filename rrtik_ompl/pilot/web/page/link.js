// The connection: pictures and states in, commands out. It comes back by itself; the session goes on meanwhile.
"use strict";

const RECONNECT_MS = 700, STALE_S = 0.5;
const token = new URLSearchParams(location.search).get("token") || "";
const pageName = sessionStorage.getItem("rrtik-page") || crypto.randomUUID?.() || String(Math.random());
sessionStorage.setItem("rrtik-page", pageName);

let socket = null, sequence = 0, me = 0;
const sent = new Map();  // sequence -> when, for the time from a key to what it changed
window.measured = { answers: [], states: 0, frames: { C: 0, O: 0 } };

function connect() {
  const query = new URLSearchParams({ page: pageName, token });
  socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/ws?${query}`);
  socket.binaryType = "arraybuffer";
  socket.onmessage = (event) => typeof event.data === "string" ? onText(JSON.parse(event.data)) : onFrame(event.data);
  socket.onclose = () => { onDisconnected(); setTimeout(connect, RECONNECT_MS); };
}

function send(name, values = {}) {
  if (!socket || socket.readyState !== WebSocket.OPEN) return;
  sequence += 1;
  sent.set(sequence, performance.now());
  socket.send(JSON.stringify({ name, seq: sequence, ...values }));
}

function shown(what) {
  if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ shown: what }));
}

function onText(said) {
  if (said.kind === "state") {
    showState(said);
    shown("state");
    window.measured.states += 1;
    measureAnswer(said.answered[me]);
  } else if (said.kind === "role") { me = said.you; showRole(said); }
  else if (said.kind === "title") { document.title = said.title; byId("title").textContent = said.title; }
  else if (said.kind === "refused") say(said.text, true);
  else if (said.kind === "pong") measureLink();
}

// How long the line to the server takes, there and back.
let pinged = 0;
function ping() {
  if (!socket || socket.readyState !== WebSocket.OPEN) return;
  pinged = performance.now();
  socket.send(JSON.stringify({ name: "ping" }));
}
function measureLink() { window.measured.link = performance.now() - pinged; showLink(window.measured.link); }
setInterval(ping, 1000);

function measureAnswer(number) {
  if (!sent.has(number)) return;
  const begin = sent.get(number);
  requestAnimationFrame(() => window.measured.answers.push(performance.now() - begin));
  if (window.measured.answers.length > 500) window.measured.answers.shift();
  for (const old of [...sent.keys()]) if (old <= number) sent.delete(old);
}

const CANVASES = { C: "camera", O: "outside" };

async function onFrame(data) {
  const kind = String.fromCharCode(new Uint8Array(data, 0, 1)[0]);
  try {
    const picture = await createImageBitmap(new Blob([new Uint8Array(data, 9)], { type: "image/jpeg" }));
    const canvas = byId(CANVASES[kind]);
    if (canvas.width !== picture.width) { canvas.width = picture.width; canvas.height = picture.height; }
    canvas.getContext("2d").drawImage(picture, 0, 0);
    picture.close();
    window.measured.frames[kind] += 1;
  } finally { shown("frame"); }
}
