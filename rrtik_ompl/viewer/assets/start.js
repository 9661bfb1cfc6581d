// The page begins: its packed parts are unpacked; the kernels are ready before the engine draws, for the first picture takes
// the browser longest, and nothing else comes to an end meanwhile. Then the engine runs, then the page's own script.
const story = JSON.parse(document.getElementById("story").textContent);
let loading = null;  // the kernels, or why they are not there

(async () => {
  const runScript = (id) => {
    const text = document.getElementById(id).textContent;
    document.body.append(Object.assign(document.createElement("script"), { textContent: text }));
  };
  if (typeof DecompressionStream !== "function") {
    const sorry = "This browser cannot unpack the page: it lacks DecompressionStream (there since Chrome 80, Firefox 113, Safari 16.4).";
    document.getElementById("pane").append(Object.assign(document.createElement("p"), { textContent: sorry }));
    return;
  }
  const unpack = async (part) => { part.textContent = new TextDecoder().decode(await unpacked(part.textContent)); };
  const kept = [...document.querySelectorAll("script[type='application/gzip']")].map((part) => [part.id, unpack(part)]);
  if (story.plan) {
    await new Map(kept).get("kernels");
    runScript("kernels");
    loading = await loadedKernels(story.plan);
    performance.mark("kernels");
  }
  await Promise.all(kept.map(([, done]) => done));
  performance.mark("unpacked");
  runScript("engine");
  runScript("page");
})();
