// Which configurations the kernels of a page call free: node page_kernels.js ASSETS < JSON of the plan, places and Q.
const fs = require("fs");
const read = (name) => fs.readFileSync(`${process.argv[2]}/${name}`, "utf8");
const source = ["unpack.js", "kernels.js", "obstacles.js", "fixed.js", "moves.js", "shapes.js"].map(read).join("");
const { Kernels, placeObstacle } = new Function(`${source}; return { Kernels, placeObstacle }`)();

(async () => {
  const { plan, place, Q } = JSON.parse(fs.readFileSync(0, "utf8"));
  const kernels = await Kernels.load(plan);
  if (place !== null) placeObstacle(kernels, plan.obstacles[0], place);
  console.log(JSON.stringify(Q.map((q) => kernels.free(q))));
})();
