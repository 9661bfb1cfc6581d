// The page's kernels in node, without a page: searches by seed, and what is free once obstacles were moved.
const fs = require("fs");
const parts = ["unpack.js", "kernels.js", "obstacles.js", "fixed.js", "moves.js", "shapes.js"];
const source = parts.map((name) => fs.readFileSync(`${process.argv[2]}/${name}`, "utf8")).join("");
const shown = new Function(`${source}; return { Kernels, placeObstacle, resized, searchMoves }`)();

function result(work) {
  let step = work.next();
  while (!step.done) step = work.next();
  return step.value;
}

const digits = (answers) => answers.map(Number).join("");

(async () => {
  const { plan, seeds, oneJoint, moves } = JSON.parse(fs.readFileSync(0, "utf8"));
  const kernels = await shown.Kernels.load(plan);
  const found = { paths: [], milliseconds: [], free: [], motions: [] };
  const search = oneJoint ? (seed) => shown.searchMoves(kernels, plan.start, plan.goal, seed) : (seed) => kernels.searchPath(plan.start, plan.goal, seed);
  for (const seed of seeds) {
    const begin = performance.now();
    found.paths.push(result(search(seed)));
    found.milliseconds.push(performance.now() - begin);
  }
  for (const { obstacle, pose, sizes, Q, motions } of moves) {
    shown.placeObstacle(kernels, shown.resized(plan.obstacles[obstacle], sizes), pose);
    found.free.push(digits(Q.map((q) => kernels.free(q))));
    found.motions.push(digits(motions.map(([a, b]) => kernels.motionFree(a, b))));
  }
  console.log(JSON.stringify(found));
})();
