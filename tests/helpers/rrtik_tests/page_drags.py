"""Random drags in a page that plans, by mouse events of DevTools: each ends in a path that Python judges, or a word.

Each drag begins in the first state of the page, and moves something by a way in space, so that the same drags can be
made in a page of another version of the library, which draws other pictures.
"""

import json
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from itertools import count, islice
from pathlib import Path
from typing import Any

import numpy as np

import rrtik_ompl as rrtik
from rrtik_ompl.viewer.opinion import opinion
from rrtik_tests.browser import DRAWING_3D, Browser

SCRIPT = Path(__file__).with_suffix(".js").read_text(encoding="utf-8")
STEPS = 3  # of the pointer in a drag
LENGTHS = 0.02, 0.4  # of a drag, beside the size of what is shown
PIXELS = 10.0, 120.0  # of a drag of a handle
NEAR = 2e-4, np.deg2rad(0.1)  # so near, a tip is where the pointer has it: of the size of what is shown, [rad]
ENDS = "start", "goal"
RESET = "drags.reset()"
IDLE = "drags.says()"  # once the page has done what its state asks for
# Places where a press takes hold of a thing itself; in any page.
SPOTS = """(() => {
  const r = pane.getBoundingClientRect();
  const places = [];
  for (let x = r.left + 4; x < r.right; x += 9) for (let y = r.top + 4; y < r.bottom; y += 9) {
    pointerAt({ clientX: x, clientY: y });
    if (hitThing()?.thing === %s && !hitHandle()) places.push([x, y]);
  }
  return places;
})()"""
GOOD = "proven", "word"
NOT_THERE = "not in the picture"  # where a drag would begin or end


@dataclass(frozen=True)
class Wanted:
    """A drag to be made.

    Attributes:
        thing: An end by name, or the number of an obstacle.
        by_handle: Whether a handle is taken, which older pages have not.
        share: Length of the drag, between the shortest and the longest one.
        angle: Direction in the picture [rad].
        seed: Decides where the pointer takes hold.
    """

    thing: object
    by_handle: bool
    share: float
    angle: float
    seed: int


@dataclass(frozen=True)
class Drag:
    """What came of a drag.

    Attributes:
        wanted: The drag.
        outcome: "proven", "word", "not in the picture", or what is wrong.
        text: What the page said.
        followed: Whether a tip went where the pointer had it; None of obstacles and of handles.
        said: All that the page said, None if the drag could not be made.
    """

    wanted: Wanted
    outcome: str
    text: str
    followed: bool | None = None
    said: dict[str, Any] | None = None

    @property
    def kind(self) -> str:
        """What was dragged: "start", "goal" or "obstacle"."""
        return str(self.wanted.thing) if self.wanted.thing in ENDS else "obstacle"


def random_drags(things: Sequence[object], seed: int, *, handles: bool) -> Iterator[Wanted]:
    """Random drags: of the start, the goal and some obstacle a third each; with handles, every second by one."""
    obstacles = [thing for thing in things if thing not in ENDS]
    for n in count():
        rng = np.random.default_rng([seed, n])
        kind = ("start", "goal", "obstacle")[int(rng.integers(3 if obstacles else 2))]
        thing = obstacles[int(rng.integers(len(obstacles)))] if kind == "obstacle" else kind
        share, turn = rng.uniform(size=2)
        yield Wanted(thing, handles and n % 2 == 1, share, 2 * np.pi * turn, int(rng.integers(1 << 31)))


class DragPage:
    """A page in which drags are made.

    Args:
        browser: In which it is open, and can plan.
        beside: The same problem's page whose first state and view this one is to have; it makes no path shorter then.
    """

    def __init__(self, browser: Browser, beside: "DragPage | None" = None) -> None:
        self.browser = browser
        browser.ask(SCRIPT)
        self.first: dict[str, Any] = browser.ask(f"drags.begin({json.dumps(None if beside is None else beside.first)})")
        self.handles: bool = self.first["handles"]

    @property
    def things(self) -> list[object]:
        """What can be dragged: ends by name, obstacles by number."""
        found: list[object] = self.first["things"]
        return found

    def reset(self) -> None:
        """Give the page its first state."""
        self.browser.ask(RESET)

    def says(self) -> dict[str, Any]:
        """What the page says, once it has done what its state asks for."""
        said: dict[str, Any] = self.browser.ask(IDLE)
        return said

    def says_in(self, other: dict[str, Any]) -> dict[str, Any]:
        """What it says in the state of which another page has said something."""
        said: dict[str, Any] = self.browser.ask(f"drags.saysIn({json.dumps(other)})")
        return said

    def some(self, problem: rrtik.Problem, number: int, seed: int) -> Iterator[Drag]:
        """What comes of random drags, by handles too if there are any; of those that the picture has room for."""
        wanted = random_drags(self.things, seed, handles=self.handles)
        made = (self.make(each, problem) for each in wanted)
        yield from islice((drag for drag in made if drag.outcome != NOT_THERE), number)

    def make(self, wanted: Wanted, problem: rrtik.Problem) -> Drag:
        """Make a drag from the first state."""
        self.reset()
        if self.handles and wanted.thing != "goal" and not self._selected(wanted):
            return Drag(wanted, NOT_THERE, "")
        spot = self.browser.ask(self._aim(wanted, by_handle=wanted.by_handle))
        if spot is None:
            return Drag(wanted, NOT_THERE, "")
        self.browser.drag(spot["press"], spot["release"], STEPS)
        said = self.says()

        followed = None
        if wanted.thing in ENDS and not wanted.by_handle:
            gap = self.browser.ask(f"drags.gap({json.dumps(wanted.thing)}, {spot['way']})")
            followed = bool(gap[0] < NEAR[0] * self.first["size"] and gap[1] < NEAR[1])
        text = f"{said['text']} {said['refusal']}".strip()
        return Drag(wanted, outcome(problem, said, titled=self.handles), text, followed, said)

    def _selected(self, wanted: Wanted) -> bool:
        """Click on a thing, which selects it; whether it is in the picture."""
        spot = self.browser.ask(self._aim(wanted, by_handle=False))
        if spot is not None:
            self.browser.drag(spot["press"], spot["press"], 1)
            assert self.browser.ask("String(selected)") == str(wanted.thing)
        return spot is not None

    def _aim(self, wanted: Wanted, *, by_handle: bool) -> str:
        low, high = PIXELS if by_handle else np.multiply(LENGTHS, self.first["size"])
        length = low + wanted.share * (high - low)
        shift = [length * np.cos(wanted.angle), length * np.sin(wanted.angle)]
        thing = "" if by_handle else f"{json.dumps(wanted.thing)}, "
        return f"drags.{'aimHandle' if by_handle else 'aim'}({thing}{json.dumps(shift)}, {wanted.seed})"


def begin(browser: Browser) -> DragPage:
    """Prepare the page in a browser, which can plan."""
    return DragPage(browser)


def outcome(problem: rrtik.Problem, said: dict[str, Any], *, titled: bool = True) -> str:
    """Judge the state of a page by Python: "proven", "word", or what is wrong; titles of old pages are of old paths."""
    if said["faults"]:
        return f"page error: {said['faults']}"
    title = f"path of {said['moves']} move{'' if said['moves'] == 1 else 's'}" if said["moves"] else "no path"
    if titled and not said["title"].endswith(title):
        return f"title: {said['title']}, but {said['moves']} moves are shown"
    if said["moves"] == 0:
        return "word" if (said["bad"] and said["text"]) or said["refusal"] else "no path and no word"
    asked = {"start": said["state"]["start"], "goal": said["state"]["goal"]}
    asked |= {"obstacles": said["obstacles"], "waypoints": said["waypoints"]}
    judged = opinion(problem, json.dumps(asked).encode())
    return "proven" if judged["verdict"] == "proven" else f"{judged['verdict']}: {judged['text']}"


@contextmanager
def drag_page(file: Path, beside: DragPage | None = None) -> Iterator[DragPage]:
    """The page in a file, in a browser of its own, ready for drags."""
    with closing(Browser(DRAWING_3D)) as browser:
        browser.open(file.resolve().as_uri())
        browser.wait("document.documentElement.dataset.plans", 200.0)
        yield DragPage(browser, beside)


def main(problem: str, number: int, *files: str) -> None:
    """Print what comes of drags in pages of a problem: random ones in the first, the same ones in the others."""
    loaded = rrtik.load_problem(problem)
    with drag_page(Path(files[0])) as page:
        drags = list(page.some(loaded, number, 1))
        print_all(files[0], drags)
        for file in files[1:]:
            with drag_page(Path(file), page) as old:
                print_all(file, [old.make(each.wanted, loaded) for each in drags if not each.wanted.by_handle])


def print_all(file: str, drags: Sequence[Drag]) -> None:
    """Print what came of drags in a page, and what is wrong line by line."""
    print(
        Path(file).name, dict(Counter((drag.kind, drag.wanted.by_handle, drag.outcome) for drag in drags)), flush=True
    )
    for drag in drags:
        if drag.outcome not in GOOD:
            print(drag.wanted, drag.outcome, drag.text, sep="\n  ")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), *sys.argv[3:])
