// The distance from obstacles along the path: a curve with the present place, the least value, and what is not proven; and what is proven, in words.
const CURVE = { left: 56, right: 382, top: 8, bottom: 68 };
const DECADES = [1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1];  // [m]

function drawn(tag, attributes, text = "") {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.textContent = text;
  document.getElementById("clearance").append(element);
  return element;
}

const millimetres = (metres) => `${Number((1000 * metres).toPrecision(3))} mm`;

/** What is proven of the motion that is played: { text, proven }, or null where nothing is said. */
function sayProof(proof) {
  document.getElementById("proof-section").hidden = !proof;
  if (!proof) return;
  const note = document.getElementById("proof-note");
  const least = (proof === story.proof && proof.proven && story.clearance?.distances[story.clearance.least]) || null;
  note.textContent = least === null ? proof.text : `${proof.text}; least clearance ${millimetres(least)}`;
  note.className = proof.proven ? "proven" : "doubtful";
}

function buildClearance(goTo) {
  const { motions, shares, distances, pairs, least } = story.clearance;
  const total = story.times[story.times.length - 1] || 1;
  const timeAt = (k) => story.times[motions[k]] + shares[k] * (story.times[motions[k] + 1] - story.times[motions[k]]);
  const far = Math.max(...distances.map((d) => d ?? 0), 1e-3);
  const near = Math.max(Math.min(...distances.map((d) => d ?? far)), 1e-5);
  const low = DECADES.filter((d) => d <= near).pop() ?? 1e-5;
  const high = Math.max(far, 10 * low);
  const x = (time) => CURVE.left + ((CURVE.right - CURVE.left) * time) / total;
  const height = (d) => Math.log(Math.min(Math.max(d ?? high, low), high) / low) / Math.log(high / low);
  const y = (d) => CURVE.bottom - (CURVE.bottom - CURVE.top) * height(d);
  document.getElementById("clearance-section").hidden = false;
  for (const k of story.proof.unproven) {
    const [begin, end] = [x(story.times[k]), x(story.times[k + 1])];
    drawn("rect", { class: "unproven", x: begin, width: end - begin, y: CURVE.top, height: CURVE.bottom - CURVE.top });
  }
  for (const d of DECADES.filter((each) => each >= low && each <= high)) {
    drawn("line", { class: "axis", x1: CURVE.left, x2: CURVE.right, y1: y(d), y2: y(d) });
    drawn("text", { x: CURVE.left - 4, y: y(d) + 4, "text-anchor": "end" }, millimetres(d));
  }
  const points = distances.map((d, k) => `${x(timeAt(k)).toFixed(1)},${y(d).toFixed(1)}`);
  drawn("polyline", { class: "curve", points: points.join(" ") });
  drawn("circle", { class: "least", cx: x(timeAt(least)), cy: y(distances[least]), r: 3.5 });
  const mark = drawn("line", { class: "now", y1: CURVE.top, y2: CURVE.bottom });
  document.getElementById("clearance").addEventListener("click", (event) => {
    const box = document.getElementById("clearance").getBoundingClientRect();
    const at = ((event.clientX - box.left) / box.width) * 388;
    goTo((total * (at - CURVE.left)) / (CURVE.right - CURVE.left));
  });
  const words = (k) => (distances[k] === null ? "no obstacle near" : `${millimetres(distances[k])}: ${pairs[k].join(" and ")}`);
  return (time) => {
    const k = distances.findIndex((_, n) => n + 1 === distances.length || timeAt(n + 1) > time);
    for (const end of ["x1", "x2"]) mark.setAttribute(end, x(time));
    document.getElementById("clearance-now").textContent = `now ${words(k)}; least ${words(least)}`;
  };
}
