// What the process that serves this page says of its paths: each is proven there once the page is done with it.
const SETTLED_MILLISECONDS = 250;  // without a change, until a path is sent
let asking = 0;  // number of the last question

function sayOpinion(text, verdict = "") {
  const line = document.getElementById("plan-opinion");
  line.hidden = text === "";
  line.textContent = text;
  line.className = `control ${verdict}`;
  if (text) sayProof({ text, proven: verdict === "proven" });  // over the picture, too
}

/** Ask about the path that is shown, once nothing has changed for a while. */
function askOpinion() {
  if (!planning.asks) return;
  asking += 1;
  const number = asking;
  sayOpinion(story.moves.length ? "rrtik: proving ..." : "");
  if (story.moves.length) setTimeout(() => { if (number === asking) sendQuestion(number); }, SETTLED_MILLISECONDS);
}

async function sendQuestion(number) {
  const obstacles = planning.obstacles.flatMap(({ name, shape, spare }, k) => {
    const { pose, sizes, shown } = state.obstacles[k];
    return spare && !shown ? [] : [{ name, shape, sizes, pose, shown }];
  });
  const body = JSON.stringify({ start: state.start, goal: state.goal, obstacles, waypoints: story.waypoints });
  let said = { verdict: "refused", text: "no answer: the process that serves this page has ended" };
  try {
    said = await (await fetch("opinion", { method: "POST", body })).json();
  } catch { /* the line says it */ }
  if (number === asking) sayOpinion(`rrtik: ${said.text}`, said.verdict);
}
