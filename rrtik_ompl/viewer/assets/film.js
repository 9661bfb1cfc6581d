// What `--film` and `--picture` add to a page: it draws one picture after the other, and hands each to whoever serves it.
const CODECS = { ".mp4": { codec: "avc1.640034", avc: { format: "annexb" } }, ".webm": { codec: "vp09.00.51.08" } };
const WAITING = 4;  // pictures that may wait to be encoded

/** Each message begins with a letter: P a picture, K and D encoded pictures, whole ones and changes, N one that is done, E an error, . the end. */
const send = (kind, ...parts) => fetch("/opinion", { method: "POST", body: new Blob([kind, ...parts]) });

/** Hands on encoded pictures in their order. */
async function encoderOf(ending, { size: [width, height], rate, bits }) {
  const settings = { ...CODECS[ending], width, height, framerate: rate, bitrate: bits };
  const known = typeof VideoEncoder === "function" && (await VideoEncoder.isConfigSupported(settings)).supported;
  if (!known) throw new Error(`this browser has no encoder for ${ending} of ${width} x ${height}; ask for ${ending === ".mp4" ? ".webm or " : ""}.gif, or use another browser`);
  let sent = Promise.resolve();
  let fault = null;
  const encoder = new VideoEncoder({
    error: (error) => { fault = error; },
    output: (chunk) => {
      const bytes = new Uint8Array(chunk.byteLength);
      chunk.copyTo(bytes);
      sent = sent.then(() => send(chunk.type === "key" ? "K" : "D", bytes));
    },
  });
  encoder.configure(settings);
  return {
    take: async (sheet, k) => {
      const frame = new VideoFrame(sheet, { timestamp: (k * 1e6) / rate, duration: 1e6 / rate });
      encoder.encode(frame, { keyFrame: k % Math.ceil(rate) === 0 });
      frame.close();
      while (encoder.encodeQueueSize > WAITING && !fault) await new Promise((done) => setTimeout(done, 1));
      if (fault) throw fault;
    },
    end: async () => {
      await encoder.flush();
      await sent;
    },
  };
}

async function drawFilm(wanted) {
  const { frames, held, at, rate, ending, camera, hide } = wanted;
  hide.filter((name) => name !== "caption").forEach(hideThing);
  hideHands(true);
  const { sheet, take } = newSheet();
  const encoder = ending in CODECS ? await encoderOf(ending, wanted) : null;
  const place = cameraOf(camera, (frames - 1) / rate);
  for (let k = 0; k < frames + (encoder ? held : 0); k += 1) {
    if (k < frames) {
      const share = frames > 1 ? k / (frames - 1) : at;
      if (frames > 1) showShare(share);
      else if (total > 0) show(total * at);
      place(share);
      viewer.render();
      take(hide.includes("caption") ? "" : captionNow());
    }
    if (encoder) await encoder.take(sheet, k);
    if (encoder && k < frames) await send("N");
    if (!encoder) await send("P", await new Promise((done) => sheet.toBlob(done, "image/png")));
  }
  await encoder?.end();
}

addEventListener("error", ({ message }) => send("E", message));
(async () => {
  try {
    while (document.documentElement.dataset.ready !== "yes") await new Promise((done) => setTimeout(done, 20));
    await drawFilm(JSON.parse(document.getElementById("film").textContent));
    await send(".");
  } catch (error) {
    await send("E", error.message);
  }
})();
