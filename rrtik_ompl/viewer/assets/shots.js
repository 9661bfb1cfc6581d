// Pictures and films of what the page shows.
const FILM_RATE = 30;  // pictures a second of a film that the page records
const LAST_SECONDS = 0.8;  // how long it shows the last picture

let hideHands = () => {};  // pages that plan have handles, which are on no picture

/** Hand a file to the person. */
function keepFile(name, blob) {
  const url = URL.createObjectURL(blob);
  make("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 1e4);
}

/** Labels and the caption stand beside the 3-D picture in the page; in a film they are drawn on it. */
function drawWords(pen, caption) {
  for (const { element, spot } of labels) {
    if (element.hidden || !spot) continue;
    const { font, color, backgroundColor, borderTopColor } = getComputedStyle(element);
    pen.font = font;
    Object.assign(pen, { fillStyle: backgroundColor, strokeStyle: borderTopColor, textBaseline: "middle", textAlign: "center" });
    pen.beginPath();
    pen.roundRect(spot.x, spot.y, spot.wide, spot.tall, 8);
    pen.fill();
    pen.stroke();
    pen.fillStyle = color;
    pen.fillText(element.textContent, spot.x + spot.wide / 2, spot.y + spot.tall / 2 + 1);
  }
  if (!caption) return;
  const tall = Math.max(16, pane.clientHeight / 28);
  pen.font = `600 ${tall}px system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif`;
  Object.assign(pen, { fillStyle: dark.matches ? "#e6ebf0" : "#1d2733", textBaseline: "bottom", textAlign: "left" });
  pen.fillText(caption, tall, pane.clientHeight - 0.8 * tall);
}

/** A canvas that takes what is drawn, with its words. */
function newSheet() {
  const { width, height } = viewer.renderer.domElement;
  const sheet = make("canvas", { width, height });
  const pen = sheet.getContext("2d", { alpha: false });
  const take = (caption = captionNow()) => {
    pen.setTransform(1, 0, 0, 1, 0, 0);
    pen.drawImage(viewer.renderer.domElement, 0, 0, width, height);
    pen.scale(width / pane.clientWidth, height / pane.clientHeight);
    drawWords(pen, caption);
  };
  return { sheet, take };
}

function keepPicture() {
  const { sheet, take } = newSheet();
  hideHands(true);
  viewer.render();  // what was drawn before may be gone from the canvas
  take();
  hideHands(false);
  sheet.toBlob((blob) => keepFile("picture.png", blob), "image/png");
}

const PLOT_LOOKS = ["fill", "stroke", "stroke-width", "opacity", "font-size"];  // of parts of a plot

/** A plot as a file of its own, in the colours that it has in the page. */
function plotText(plot) {
  const copy = plot.cloneNode(true);
  const parts = [...copy.querySelectorAll("*")];
  [...plot.querySelectorAll("*")].forEach((part, k) => {
    const look = getComputedStyle(part);
    parts[k].setAttribute("style", PLOT_LOOKS.map((name) => `${name}: ${look.getPropertyValue(name)}`).join("; "));
  });
  copy.setAttribute("xmlns", "http://www.w3.org/2000/svg");
  copy.setAttribute("style", `font-family: sans-serif; background: ${getComputedStyle(document.body).backgroundColor}`);
  return copy.outerHTML;
}

const shownPlots = () => [...document.querySelectorAll("aside svg")].filter((plot) => plot.closest("section").hidden === false);

function keepPlots() {
  for (const plot of shownPlots()) keepFile(`${plot.id}.svg`, new Blob([plotText(plot)], { type: "image/svg+xml" }));
}

let recording = null;

/** Play from the start to the end, and record it; pressed again, it ends there. */
function recordFilm() {
  if (recording) return recording.finish();
  if (story.moves.length === 0) return null;  // nothing moves yet
  const kinds = ["video/mp4;codecs=avc1.640034", "video/webm;codecs=vp9", "video/webm"];
  const mimeType = kinds.find((kind) => window.MediaRecorder?.isTypeSupported(kind));
  const button = document.getElementById("film-button");
  if (!mimeType) {
    button.disabled = true;
    button.title = "this browser cannot record films; rrtik show --film FILE does";
    return null;
  }
  const { sheet, take } = newSheet();
  const recorder = new MediaRecorder(sheet.captureStream(FILM_RATE), { mimeType, videoBitsPerSecond: 1e7 });
  const parts = [];
  const render = viewer.render;
  viewer.render = () => { render(); take(); };
  recorder.addEventListener("dataavailable", ({ data }) => parts.push(data));
  recorder.addEventListener("stop", () => keepFile(`film.${mimeType.includes("mp4") ? "mp4" : "webm"}`, new Blob(parts, { type: mimeType })));
  const finish = () => {
    hideHands(false);
    viewer.render = render;
    recording = null;
    button.textContent = "Film";
    pause();
    recorder.stop();
  };
  recording = { finish, ended: () => setTimeout(() => recording?.finish(), 1000 * LAST_SECONDS) };
  button.textContent = "Stop";
  hideHands(true);
  goTo(0);
  viewer.render();
  recorder.start();
  play();
  return recording;
}

document.getElementById("picture-button").addEventListener("click", keepPicture);
document.getElementById("film-button").addEventListener("click", recordFilm);
document.getElementById("plot-button").addEventListener("click", keepPlots);
document.getElementById("plot-button").hidden = shownPlots().length === 0;
document.getElementById("view-button").addEventListener("click", () => keepFile("view.yaml", new Blob([viewText()])));
document.getElementById("film-button").hidden = !robot || (story.moves.length === 0 && !story.plan);
