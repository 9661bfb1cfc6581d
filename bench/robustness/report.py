"""Attacks on the public face, the servers and long work: how many, and what broke.

The stored page says at which sizes it was made. What is done stands beside the page until that is written: an
interrupted run goes on where it was.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

from typer import Option

from bench import fuzz
from bench.robustness import bad_clients, bad_pages, faults
from bench.robustness.bad_inputs import bad
from bench.robustness.long_work import WORK
from bench.shared.clocks import resident
from bench.shared.parts import Parts
from bench.shared.run import Run
from rrtik_bench.report.page import Report
from rrtik_ompl import load_problem, plan, view
from rrtik_ompl.base.choices import one_of

CALLS, MESSAGES, INPUTS, TRIALS = fuzz.BATCH, 480, 25, 10  # of a part
LOOKS = 4
FLAT_MB = 1.0
PEERS: dict[str, tuple[str, Callable[[int, int], list[str]]]] = {
    "line server": ("a client of the arm's line: the arm stops, the next is served", bad_clients.line_server),
    "line arm": ("a server of an arm: the line comes back, no joints that cannot be", bad_clients.arm_of_a_line),
    "page": ("a browser at `rrtik show`: the page is served, under no other name", bad_clients.page_server),
    "pilot": ("pages at `rrtik pilot`: watchers move nothing, the arm stops", bad_pages.pilot_server),
}


def calls(first: int, count: int) -> list[str]:
    """Calls of the fuzz from a number on; what was wrong."""
    with TemporaryDirectory() as folder:
        return [f"{seed}: {wrong}" for seed, wrong in fuzz.run(first, count, Path(folder))]


def messages(peer: str, first: int, count: int) -> list[str]:
    """Messages to a peer from a number on; the rules that it did not keep."""
    return PEERS[peer][1](first, count)


def trials(work: str, kind: str, first: int, count: int) -> list[str]:
    """Trials of a fault from a number on; what was lost, doubled or half."""
    return faults.trials(work, kind, first, count)


def memory(what: str, count: int) -> list[float]:
    """Resident memory [MB] after each quarter of many plans or pages in one process; the first one warms up."""
    problem, sizes = load_problem("planar3_boxes"), list[float]()
    with TemporaryDirectory() as folder:
        for number in range(1, count + 1):
            path = plan(problem, "bicrdt", seed=1 if what == "pages" else number, shorten=False).path
            if what == "pages":
                view(problem, path, html=Path(folder) / "page.html")
            if number % max(count // LOOKS, 1) == 0:
                gc.collect()
                sizes.append(resident())
    return sizes


def main(
    run: Run,
    parts: Parts,
    *,
    fuzzed: Annotated[int, Option("--calls", help="Of public functions, commands and readers of files.")] = 2000,
    sent: Annotated[int, Option("--messages", help="To each server.")] = 960,
    faulty: Annotated[int, Option("--faults", help="Trials of each fault of each long work.")] = 5,
    kills: Annotated[int, Option(help="Of each long work.")] = 20,
    plans: Annotated[int, Option(help="Over which the memory is watched.")] = 400,
    pages: Annotated[int, Option(help="Over which the memory is watched.")] = 40,
    inputs: Annotated[int, Option("--bad", help="Inputs that are all bad.")] = 100,
    works: Annotated[list[str] | None, Option(help="Long work that is disturbed; may be repeated.")] = None,
    few: Annotated[list[str] | None, Option(help="Long work with one trial of each fault; may be repeated.")] = None,
) -> Report:
    """Attack."""
    disturbed = [one_of(WORK, name, "long work") for name in works or WORK]
    rarely = [one_of(WORK, name, "long work") for name in few or ()]
    report = run.report("Nothing breaks it")
    report.intro = (
        "Wanted are 1,000,000 calls, 10,000 messages to each server, 2,000 kills and interrupts, 20,000 plans and "
        "2,000 pages, 2,000 bad inputs; the numbers below are those of this run. Of the calls a quarter are files that "
        "are spoilt and read, a twentieth commands, the rest public functions and methods, of whose values three in "
        "five fit their parameter."
    )
    _calls(report, parts(calls, _blocks(fuzzed, CALLS)), fuzzed)
    _bad_inputs(report, parts(bad, _blocks(inputs, INPUTS)), inputs)
    _peers(report, parts, sent)
    _faults(report, parts, (faulty, kills), disturbed, rarely)
    for what, count in (("plans", plans), ("pages", pages)):
        _memory(report, what, count, parts(memory, [(what, count)])[0])
    return report


def _blocks(count: int, size: int) -> list[tuple[int, int]]:
    return [(first, min(size, count - first)) for first in range(0, count, size)]


def _calls(report: Report, found: Sequence[list[str]], count: int) -> None:
    wrong = [each for part in found for each in part]
    report.bar("calls of the fuzz", "no crash, no hang, no raw exception", f"{len(wrong)} of {count:,}", not wrong)
    report.note("Finds of the fuzz", _listed(wrong))


def _bad_inputs(report: Report, found: Sequence[list[str]], count: int) -> None:
    wrong = [each for part in found for each in part]
    wanted = "one line, exit code 2, within 2 s of the processor and 1 GB"
    report.bar(
        "bad inputs, of all commands and kinds of file", wanted, f"{len(wrong)} otherwise of {count:,}", not wrong
    )
    report.note("Bad inputs", _listed(wrong))


def _peers(report: Report, parts: Parts, count: int) -> None:
    rows, wrong = [], list[str]()
    for peer, (rule, _) in PEERS.items():
        found = [each for part in parts(messages, [(peer, *b) for b in _blocks(count, MESSAGES)]) for each in part]
        rows.append([peer, rule, f"{count:,}", str(len(found))])
        wrong += [f"{peer}, {each}" for each in found]
    measured = f"{len(wrong)} broken in {count:,} messages to each of {len(PEERS)}"
    report.bar("messages of mutating peers", "pilot and arm keep their rules", measured, not wrong)
    report.table("Mutating peers", ["peer", "rule", "messages", "broken"], rows, text=_listed(wrong))


def _faults(report: Report, parts: Parts, counts: tuple[int, int], works: Sequence[str], few: Sequence[str]) -> None:
    count, kills = counts
    rows, wrong, whole = [], list[str](), 0
    for work in works:
        shown = []
        for kind in faults.KINDS:
            n = 1 if work in few else {"clock": 1, "kill": kills}.get(kind, count)
            found = [each for part in parts(trials, [(work, kind, *b) for b in _blocks(n, TRIALS)]) for each in part]
            shown.append(f"{len(found)} of {n}")
            wrong += [f"{work}, {kind}, {each}" for each in found]
            whole += n
        rows.append([work, *shown])
    wanted = "nothing lost that was said to be done, nothing doubled, no half file"
    report.bar("kills, interrupts, full disks, clocks", wanted, f"{len(wrong)} in {whole} trials", not wrong)
    report.table("Faults of long work", ["work", *faults.KINDS], rows, text=_listed(wrong))


def _memory(report: Report, what: str, count: int, sizes: Sequence[float]) -> None:
    grown = sizes[-1] - sizes[0] if len(sizes) > 1 else 0.0
    measured = f"{grown:+.1f} MB over the last {count - count // LOOKS:,}"
    report.bar(f"{count:,} {what} in one process", f"flat to {FLAT_MB:g} MB after warm-up", measured, grown <= FLAT_MB)


def _listed(wrong: Sequence[str]) -> str:
    return "None." if not wrong else "\n".join(f"- `{each.replace('`', '')[:300]}`" for each in wrong)
