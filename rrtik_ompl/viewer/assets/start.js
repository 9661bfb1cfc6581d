// The page begins: its packed parts are unpacked, then the engine runs, then the page's own script.
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
  for (const part of document.querySelectorAll("script[type='application/gzip']")) {
    part.textContent = new TextDecoder().decode(await unpacked(part.textContent));
  }
  runScript("engine");
  runScript("page");
})();
