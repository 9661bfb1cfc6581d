// What `rrtik show --film` adds to a page: it draws one picture after the other and hands each to whoever serves it.
(async () => {
  const wanted = JSON.parse(document.getElementById("film").textContent);
  while (document.documentElement.dataset.ready !== "yes") await new Promise((done) => setTimeout(done, 20));
  const send = (body) => fetch("/opinion", { method: "POST", body });
  for (let k = 0; k < wanted.frames; k += 1) {
    if (total > 0) show((total * k) / Math.max(wanted.frames - 1, 1));
    await send(viewer.capture_image());
  }
  await send("end");
})();
