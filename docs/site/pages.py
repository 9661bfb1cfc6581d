"""What MkDocs is told about the pages: their links to the rest of the repository, and the pages of the public names."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

import rrtik_ompl
from rrtik_ompl.base.lazy import public_values

ROOT = Path(__file__).resolve().parents[2]
LINK = re.compile(r"\]\((\.\./[^)\s#]+)(#[^)\s]*)?\)")
PICTURES = ROOT / "bench" / "reports"
PICTURE = re.compile(
    r"\]\((?:https://raw\.githubusercontent\.com/rrtik-ompl/rrtik-ompl/main|\.\.)/bench/reports/([\w.-]+\.(?:png|gif))\)"
)
# The pages of the public names, and the rooms or modules that each of them is of; the longest that fits counts.
REFERENCE = {
    "Robots and scenes": ("description", "model", "files", "base.poses", "world"),
    "Goals and problems": ("model.goal", "model.goal_kind", "constraints", "world.problem", "problem_files"),
    "Plans and paths": ("planning", "world.path", "benchmark", "viewer"),
    "Certificates": ("world.certificates",),
    "Inverse kinematics": ("ik",),
    "Lines of the tip and tasks": ("planning.tip_motion", "tasks"),
    "Trajectories and following": ("motion",),
    "Moving obstacles": ("replanning",),
    "Cameras": ("sensing", "world.robot_points"),
    "Own OMPL code": ("ompl_bridge",),
    "Errors": ("base.errors",),
}


def on_files(files: Files, config: Any) -> Files:
    """Add the front page, which is the README, the pictures, and one page for each group of public names."""
    files.append(File.generated(config, "index.md", content=_front_page()))
    for picture in [*PICTURES.glob("*.png"), *PICTURES.glob("*.gif")]:
        files.append(File.generated(config, f"pictures/{picture.name}", abs_src_path=str(picture)))
    for title, names in _groups().items():
        text = [f"# {title}", *(f"::: {name}" for name in names)]
        files.append(File.generated(config, _reference_file(title), content="\n\n".join(text) + "\n"))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Point links that leave the folder of the documents to the repository.

    Raises:
        FileNotFoundError: If there is no such file in it.
    """
    folder = ROOT / "docs" / Path(page.file.src_uri).parent

    def target(found: re.Match[str]) -> str:
        file = (folder / found[1]).resolve()
        if file.is_relative_to(ROOT / "docs"):
            return found[0]
        if not file.exists():
            raise FileNotFoundError(f"{page.file.src_uri}: no {found[1]} in the repository")
        kind = "tree" if file.is_dir() else "blob"
        return f"]({config.repo_url}/{kind}/main/{file.relative_to(ROOT).as_posix()}{found[2] or ''})"

    up = "../" * page.file.src_uri.count("/")
    return LINK.sub(target, PICTURE.sub(rf"]({up}pictures/\1)", markdown))


def _front_page() -> str:
    """The README, with its links as seen from the folder of the documents."""

    def moved(found: re.Match[str]) -> str:
        return f"]({found[1].removeprefix('docs/')})" if found[1].startswith("docs/") else f"](../{found[1]})"

    text = (
        (ROOT / "README.md").read_text(encoding="utf-8").replace("](docs/README.md)", "](docs/tutorials/first_plan.md)")
    )
    return re.sub(r"\]\((?!https?:|#)([^)]+)\)", moved, text)


def _groups() -> dict[str, list[str]]:
    """For each page the full names of what is on it.

    Raises:
        ValueError: If a public name has no page.
    """
    groups: dict[str, list[str]] = {title: [] for title in REFERENCE}
    for public_name, value in public_values(rrtik_ompl).items():
        name = public_name.split(".")[-1]
        home = value.__module__ if hasattr(value, "__module__") else value.__name__.rpartition(".")[0]
        full = f"{home}.{name}"
        assert getattr(import_module(home), name) is value
        fitting = {part: title for part, title in _homes().items() if full.startswith(f"rrtik_ompl.{part}.")}
        if not fitting:
            raise ValueError(f"{full} is on no page: give its room one in REFERENCE of docs/site/pages.py")
        groups[fitting[max(fitting, key=len)]].append(full)
    return groups


def _homes() -> dict[str, str]:
    """The page of each room or module."""
    return {part: title for title, parts in REFERENCE.items() for part in parts}


def _reference_file(title: str) -> str:
    return f"reference/{title.lower().replace(' ', '_')}.md"
