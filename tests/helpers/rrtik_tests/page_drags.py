"""Random drags in a page that plans, by mouse events of DevTools: each ends in a path that Python judges, or a word."""

import json
import sys
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import rrtik_ompl as rrtik
from rrtik_ompl.viewer.opinion import opinion
from rrtik_tests.browser import DRAWING_3D, SMALL, Browser

FARTHEST = 200.0  # [px] that the pointer goes in a drag

# Nothing has to be seen: the page works as ever, but the processor draws no pictures.
BEGIN = """(() => {
  window.faults = [];
  addEventListener("error", ({ message }) => faults.push(message));
  addEventListener("unhandledrejection", ({ reason }) => faults.push(String(reason)));
  viewer.renderer.render = () => viewer.scene.updateMatrixWorld();
  window.firstState = copyOf(state);
  const free = [...planning.obstacles.keys()].filter((k) => isMovable(k) && !planning.obstacles[k].locked);
  return [...ENDS.keys(), ...free];
})()"""
RESET = """(() => {
  state = copyOf(firstState);
  past.length = 0;
  state.obstacles.forEach((_, k) => applyObstacle(k));
  select("goal");
  lookFrom("Overview");
  viewer.render();
  changed();
})()"""
# Places where a press takes hold of a thing itself.
SPOTS = """(() => {
  const r = pane.getBoundingClientRect();
  const places = [];
  for (let x = r.left + 4; x < r.right; x += 9) for (let y = r.top + 4; y < r.bottom; y += 9) {
    pointerAt({ clientX: x, clientY: y });
    if (hitThing()?.thing === %s && !(typeof hitHandle === "function" && hitHandle())) places.push([x, y]);
  }
  return places;
})()"""
GRIPS = """(() => {
  viewer.render();
  const r = pane.getBoundingClientRect();
  const places = [];
  for (let x = r.left + 4; x < r.right; x += 3) for (let y = r.top + 4; y < r.bottom; y += 3) {
    pointerAt({ clientX: x, clientY: y });
    if (hitHandle()) places.push([x, y]);
  }
  return places;
})()"""
IDLE = """(async () => {
  const line = () => document.getElementById("plan-state").textContent;
  const frame = () => new Promise((done) => requestAnimationFrame(done));
  const frames = async (n) => { for (let k = 0; k < n; k += 1) await frame(); };
  await frames(2);
  for (let before = null; line() !== before || line() === "searching ...";) { before = line(); await frames(4); }
  const refusal = document.getElementById("plan-refusal");
  return {
    state, text: line(), bad: document.getElementById("plan-state").classList.contains("bad"),
    refusal: refusal.hidden ? "" : refusal.textContent, moves: story.moves.length, waypoints: story.waypoints,
    title: document.getElementById("title").textContent, faults,
    obstacles: planning.obstacles.flatMap(({ name, shape, spare }, k) => {
      const { pose, sizes, shown } = state.obstacles[k];
      return spare && !shown ? [] : [{ name, shape, sizes, pose, shown }];
    }),
  };
})()"""


@dataclass(frozen=True)
class Drag:
    """What came of a drag: "proven", "word", or what is wrong, with what the page said."""

    thing: object
    by_handle: bool
    outcome: str
    text: str


def begin(browser: Browser) -> list[object]:
    """Prepare a page for drags; return what can be dragged: ends by name, obstacles by number."""
    return browser.ask(BEGIN)


def dragged(browser: Browser, thing: object, rng: np.random.Generator, *, by_handle: bool, selects: bool) -> bool:
    """Drag a thing, or a handle of it, by some pixels; whether it is in the picture.

    Args:
        browser: With the page, in its first state.
        thing: An end by name, or the number of an obstacle.
        rng: Decides where and how far.
        by_handle: Whether to take a handle.
        selects: Whether the thing must be clicked first, as in pages with handles.
    """
    share, angle = rng.uniform(size=2)
    length = rng.uniform(10.0, FARTHEST)
    spots = browser.ask(SPOTS % json.dumps(thing))
    if not spots:
        return False
    spot = spots[int(share * len(spots))]
    if selects and thing != "goal":
        for kind in ("mousePressed", "mouseReleased"):
            browser.call("Input.dispatchMouseEvent", type=kind, x=spot[0], y=spot[1], button="left", clickCount=1)
        assert browser.ask("String(selected)") == str(thing)
    if by_handle:
        grips = browser.ask(GRIPS)
        if not grips:
            return False
        spot = grips[int(share * len(grips))]
    browser.drag(spot, [spot[0] + length * np.cos(angle * 2 * np.pi), spot[1] + length * np.sin(angle * 2 * np.pi)], 5)
    return True


def outcome(problem: rrtik.Problem, said: dict[str, Any]) -> str:
    """Judge the state of a page by Python: "proven", "word", or what is wrong."""
    if said["faults"]:
        return f"page error: {said['faults']}"
    title = f"path of {said['moves']} move{'' if said['moves'] == 1 else 's'}" if said["moves"] else "no path"
    if not said["title"].endswith(title):
        return f"title: {said['title']}, but {said['moves']} moves are shown"
    if said["moves"] == 0:
        return "word" if (said["bad"] and said["text"]) or said["refusal"] else "no path and no word"
    asked = {"start": said["state"]["start"], "goal": said["state"]["goal"]}
    asked |= {"obstacles": said["obstacles"], "waypoints": said["waypoints"]}
    judged = opinion(problem, json.dumps(asked).encode())
    return "proven" if judged["verdict"] == "proven" else f"{judged['verdict']}: {judged['text']}"


def random_drags(
    browser: Browser,
    problem: rrtik.Problem,
    things: list[object],
    count: int,
    seed: int,
    *,
    handles: bool,
    selects: bool,
) -> Iterator[Drag]:
    """Yield what comes of drags, each from the first state of the page; with handles, every second takes one."""
    for n in range(count):
        rng = np.random.default_rng([seed, n])
        thing = things[int(rng.integers(len(things)))]
        by_handle = handles and n % 2 == 1
        browser.ask(RESET)
        browser.ask(IDLE)
        if not dragged(browser, thing, rng, by_handle=by_handle, selects=selects):
            yield Drag(thing, by_handle, "not in the picture", "")
            continue
        said = browser.ask(IDLE)
        yield Drag(thing, by_handle, outcome(problem, said), f"{said['text']} {said['refusal']}".strip())


def main(problem: str, count: int, *files: str) -> None:
    """Compare pages of a problem, the first of them with handles: the same drags in each, and as many by handles."""
    loaded = rrtik.load_problem(problem)
    things: list[object] = []
    for number, file in enumerate(files):
        with closing(Browser(DRAWING_3D)) as browser:
            browser.open(Path(file).as_uri())
            browser.size(*SMALL)
            browser.wait("document.documentElement.dataset.plans", 200.0)
            things = begin(browser) if number == 0 else (begin(browser), things)[1]
            counts: dict[tuple[bool, str], int] = {}
            for drag in random_drags(browser, loaded, things, count, 1, handles=number == 0, selects=number == 0):
                key = drag.by_handle, drag.outcome
                counts[key] = counts.get(key, 0) + 1
                if drag.outcome not in ("proven", "word"):
                    print(problem, file, drag, flush=True)
            print(problem, Path(file).name, things, counts, flush=True)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), *sys.argv[3:])
