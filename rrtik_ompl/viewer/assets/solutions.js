// Solutions of inverse kinematics: a table beside the picture; a click brings the arm to one, which is the goal of a page that plans.
function showSolution(k) {
  document.querySelectorAll("#solutions tr").forEach((row, n) => row.classList.toggle("moving", n === k + 1));
  const { q } = story.ghosts[k];
  if (story.plan) {
    const list = document.getElementById("plan-goal");
    now = Infinity;  // a new path is shown at its end
    list.value = k;
    list.dispatchEvent(new Event("change"));
  } else standAt(q);
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
