// Solutions of inverse kinematics: a table beside the picture; a click brings the arm to one, which is the goal of a page that plans.
const SAME_SOLUTION = 1e-6;  // [rad or m]; a goal is put inside the limits, from where rounding left it

/** Mark the solution at a configuration, or none where it is no solution; its number, -1 for none. */
function markSolution(q) {
  const found = story.ghosts.findIndex((ghost) => ghost.q.every((value, j) => Math.abs(value - q[j]) < SAME_SOLUTION));
  document.querySelectorAll("#solutions tr").forEach((row, n) => row.classList.toggle("moving", n === found + 1 && n > 0));
  return found;
}

function showSolution(k) {
  const { q } = story.ghosts[k];
  if (story.plan) {
    const list = document.getElementById("plan-goal");
    now = Infinity;  // a new path is shown at its end
    list.value = k;
    list.dispatchEvent(new Event("change"));
  } else {
    standAt(q);
    markSolution(q);
  }
}

function buildSolutions() {
  document.getElementById("solutions-section").hidden = false;
  const table = document.getElementById("solutions");
  const units = [...new Set(robot.joints.map(({ unit }) => unit))].join(" or ");
  const heads = ["no.", ...robot.joints.map(({ name }, j) => make("abbr", { title: name, textContent: j + 1 }))];
  table.append(make("tr", {}, ...heads.map((head, k) => make("th", { className: k ? "number" : "" }, head))));
  document.getElementById("solutions-note").textContent = `joints in ${units}; click one to go there`;
  story.ghosts.forEach((ghost, k) => {
    const { color, q } = ghost;
    const swatch = make("span", { className: "swatch" });
    swatch.style.background = drawnGhosts.includes(ghost) ? color : "none";
    const values = q.map((value, j) => make("td", { className: "number", textContent: reading(j, value) }));
    const row = make("tr", {}, make("td", {}, swatch, ` ${k + 1}`), ...values);
    row.addEventListener("click", () => showSolution(k));
    table.append(row);
  });
}
