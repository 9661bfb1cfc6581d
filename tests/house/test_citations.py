"""Citations point to REFERENCES.md by number: each number is there, each entry is cited, each work has its number."""

import ast
import io
import re
import tokenize
from functools import cache

import pytest

from rrtik_tests.places import ROOT

FOLDERS = ("rrtik_ompl", "planners", "robots", "bench")
KINDS = (".py", ".md", ".yaml")
NEAR = 80  # characters of text around a name in which its number stands
NOT_USED = {14}  # the entry that says of itself that nothing is taken from it yet

_PLACE = r"(?:, (?:ch\.|app\.|tables?|figures?|sections?|algorithms?|equations?|EXTEND)[^][;]*)?"
CITATION = re.compile(rf"(?<![\w\])\"'.])\[([1-9]\d?{_PLACE}(?:; [1-9]\d?{_PLACE})*)\](?![(\[])")
NAMED = re.compile(r"\b[A-Z][^\W\d_]+(?:,? (?:and )?[A-Z][^\W\d_]+| et al\.)*,? \(?(?:19[3-9]|20[0-4])\d\b(?!-\d)")
JOURNAL = re.compile(r"\b(?:IJRR|ICRA|Transactions on|Journal of|Proceedings of)\b")
UNNAMED = re.compile(r"\b(?:the|this|their) (?:paper|article|publication|thesis|dissertation)(?:'s)?\b", re.IGNORECASE)
SHEETS = re.compile(r"(?:out of|on|does not fit) the paper")  # printed markers lie on paper
WITHHELD = (  # names of sources that no reader can look up; REFERENCES.md has them by number
    *("C-RDT paper", "GA-REB paper", "IKURT paper", "DRRT-Con paper", "MB-RRT paper", "post-processing paper"),
    *("shared-control tool", "the specification", "kinematics specification", "Post-processing page", "test plan"),
)
PRIVATE = re.compile(r"\bsections? \d|(?:^|\()[Rr]ows? \d+(?:(?: and|,) \d+)?[:)]|\b[A-Z-]+ (?:paper|publication)\b")


@cache
def texts(file):
    """What a reader reads: comments and strings of Python, comments of YAML, prose of Markdown; breaks are spaces."""
    text = file.read_text(encoding="utf-8")
    if file.suffix == ".py":
        tokens = tokenize.generate_tokens(io.StringIO(text).readline)
        comments = [(t.start[0], t.string) for t in tokens if t.type == tokenize.COMMENT]
        blocks = [" ".join(part) for part in _runs(comments)]
        strings = [n.value for n in ast.walk(ast.parse(text)) if isinstance(n, ast.Constant)]
        blocks += [each for each in strings if isinstance(each, str)]
    elif file.suffix == ".yaml":
        blocks = [re.sub(r"^#|\n#", " ", part) for part in re.findall(r"(?:^#.*\n?)+", text, re.MULTILINE)]
    else:
        blocks = [re.sub(r"^```.*?^```|`[^`\n]*`", "", text, flags=re.MULTILINE | re.DOTALL)]
    return [" ".join(block.split()) for block in blocks]


def _runs(comments):
    """Texts of comments that stand in lines one after another."""
    runs, last = [], None
    for line, text in comments:
        if last is None or line != last + 1:
            runs.append([])
        runs[-1].append(text.lstrip("# "))
        last = line
    return runs


def numbers(text):
    return {int(part.split(",")[0]) for found in CITATION.findall(text) for part in found.split(";")}


def without_number(text, pattern):
    """What the pattern finds with no citation near it."""
    found = []
    for match in pattern.finditer(text):
        if not CITATION.search(text[max(0, match.start() - NEAR) : match.end() + NEAR]):
            found.append(match[0])
    return found


def files(*folders):
    return [file for folder in folders for file in sorted((ROOT / folder).rglob("*")) if file.suffix in KINDS]


@pytest.fixture(scope="module")
def entries():
    return {int(number) for number in re.findall(r"^(\d+)\. ", (ROOT / "REFERENCES.md").read_text(), re.MULTILINE)}


@pytest.mark.parametrize("folder", FOLDERS)
def test_a_work_is_named_with_its_number(folder):
    found = []
    for file in files(folder):
        for text in texts(file):
            plain = SHEETS.sub("", text)
            words = [word for pattern in (NAMED, JOURNAL, UNNAMED) for word in without_number(plain, pattern)]
            words += PRIVATE.findall(CITATION.sub("", plain))
            found += [(str(file.relative_to(ROOT)), word) for word in words]
    assert found == []


def test_no_source_is_named_that_no_reader_can_look_up():
    words = re.compile("|".join(WITHHELD), re.IGNORECASE)
    inside = [file for folder in (*FOLDERS, "docs", "tests") for file in (ROOT / folder).rglob("*")]
    texts = [file for file in inside if file.suffix in (".py", ".md", ".yaml", ".js", ".html")]
    pages = [file for file in (*ROOT.glob("*.md"), *texts) if file.name != "test_citations.py"]
    assert [str(file) for file in pages if words.search(" ".join(file.read_text(encoding="utf-8").split()))] == []


@pytest.mark.parametrize("folder", [*FOLDERS, "docs", "tests"])
def test_every_number_that_is_cited_is_in_the_references(folder, entries):
    cited = [(str(file.relative_to(ROOT)), n) for file in files(folder) for text in texts(file) for n in numbers(text)]
    assert [(file, number) for file, number in cited if number not in entries] == []


def test_every_reference_is_cited(entries):
    pages = [ROOT / name for name in ("README.md", "ARCHITECTURE.md", "CONTRIBUTING.md")]
    cited = {number for file in [*files(*FOLDERS, "docs"), *pages] for text in texts(file) for number in numbers(text)}
    assert entries - cited == NOT_USED


@pytest.mark.parametrize(
    ("text", "cited", "bare"),
    [
        ("the smaller tree grows [5]; see [8; 1, ch. 5.2, algorithms 6 to 8]", {1, 5, 8}, []),
        ("a ring is cut (Meisters 1975)", set(), ["Meisters 1975"]),
        ("fitted (Steele, Lea, Flood 2014)", set(), ["Steele, Lea, Flood 2014"]),
        ("after Corke and Armstrong (1994)", set(), ["Corke and Armstrong (1994"]),
        ("hues of Okabe and Ito, 2008 [55]", {55}, []),
        ("the paper's letter", set(), ["the paper's"]),
        ("see [the page](page.md), x[3], spans [0.8, 1.3] and [1](a.md)", set(), []),
    ],
)
def test_citations_and_bare_names_are_told_apart(text, cited, bare):
    assert numbers(text) == cited
    assert without_number(text, NAMED) + without_number(text, UNNAMED) == bare
