// What the report does in a page: random drags whose files are sent home, and drags that are timed until a path is drawn.
(() => {  // the names of the page's own script are not ours
  let at = null;  // when the page first had the path of a drag

  function randomNumbers(seed) {  // a linear congruential generator: the same drags every time
    let value = seed;
    return () => {
      value = (Math.imul(value, 1664525) + 1013904223) >>> 0;
      return value / 2 ** 32;
    };
  }

  /** Move, turn, add, remove or resize something. */
  function drag(random) {
    const gap = () => 0.25 * size * (random() - 0.5);
    const choice = random();
    if (choice < 0.5) select(choice < 0.25 ? "goal" : "start");
    else if (choice < 0.58) addShape(["box", "sphere", "cylinder", "capsule"][Math.floor(4 * random())]);
    else {
      const shown = [...planning.obstacles.keys()].filter((k) => state.obstacles[k].shown);
      if (shown.length) select(shown[Math.floor(shown.length * random())]);
      if (choice < 0.62 && !isEnd(selected)) removeSelected();
      else if (choice < 0.7 && !isEnd(selected)) {
        const k = selected;
        state.obstacles[k].sizes = state.obstacles[k].sizes.map((length) => length * (0.5 + random()));
        applyObstacle(k);
      }
    }
    moveSelected(new THREE.Vector3(gap(), gap(), gap()), random() - 0.5);
  }

  function last(work, result) {
    let [step, given] = [work.next(), null];
    for (; !step.done; step = work.next()) given = step.value;
    return result ? step.value : given;
  }

  /** The files of what the page finds now, without waiting for frames; null where an end is blocked or no path is found. */
  function filesNow() {
    shortening += 1;
    if ([...ENDS.keys()].some((end) => !kernels.free(state[end]))) return null;
    const { search, shorten } = PLANNERS[state.planner];
    const found = last(search(state.seed), true);
    if (!found) return null;
    replacePath(last(shorten(found), false) ?? found);
    return { path: pathText(), problem: problemText() };
  }

  function randomDrags(count, seed) {
    const random = randomNumbers(seed);
    const files = [];
    for (let n = 0; n < count; n += 1) {
      remember();
      drag(random);
      files.push(filesNow());
      if (files[n] === null) undo();
    }
    return files;
  }

  const frame = () => new Promise((done) => { requestAnimationFrame(done); });

  async function timedDrags(count, seed) {
    const [random, times, waits] = [randomNumbers(seed), [], []];
    const draw = replacePath;
    window.replacePath = (rows) => { at ??= performance.now(); draw(rows); };
    for (let n = 0; n < count; n += 1) {
      const begin = performance.now();
      at = null;
      remember();
      select("goal");
      moveSelected(new THREE.Vector3(...[0, 1, 2].map(() => 0.04 * size * (random() - 0.5))), 0);
      for (let k = 0; k < 200 && at === null; k += 1) await frame();
      await frame();  // in which it is drawn; at the next one it has been
      await frame();
      if (at !== null && story.moves.length) {
        times.push(performance.now() - begin);
        waits.push(at - begin);
      } else undo();
      for (let k = 0; k < 5; k += 1) await frame();
    }
    window.replacePath = draw;
    return { times, waits };
  }

  async function work() {
    const { drags, timed, seed } = JSON.parse(document.getElementById("work").textContent);
    while (document.documentElement.dataset.plans !== "yes") await frame();
    const loaded = performance.now();
    const [kernelsAt, unpackedAt, viewerAt] = ["kernels", "unpacked", "viewer"].map((name) => performance.getEntriesByName(name)[0].startTime);
    const found = await timedDrags(timed, seed);
    const files = randomDrags(drags, seed);
    const loading = { loaded, kernels: kernelsAt, drawing: viewerAt - unpackedAt };
    await fetch("opinion", { method: "POST", body: JSON.stringify({ ...loading, ...found, files }) });
  }

  work();
})();
