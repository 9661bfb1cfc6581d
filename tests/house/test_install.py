"""What is said in several places about installing agrees: versions, platforms, links, dependencies."""

import re

import pytest
import yaml

import rrtik_ompl
from rrtik_ompl.base.floors import FLOORS
from rrtik_tests.places import ROOT

PROJECT = (ROOT / "pyproject.toml").read_text()
README = (ROOT / "README.md").read_text()
WORKFLOWS = {file.stem: file.read_text() for file in (ROOT / ".github" / "workflows").glob("*.yml")}
RECIPE = yaml.safe_load((ROOT / "recipe" / "recipe.yaml").read_text())
CONDA_NAMES = {
    "pin": "pinocchio-python",
    "coal": "coal-python",
    "example-robot-data": "example-robot-data-loaders",
    "opencv-python-headless": "py-opencv",
    "meshcat": "meshcat-python",
    "matplotlib": "matplotlib-base",
    "PyYAML": "pyyaml",
}


def bounds():
    """Lower bounds of the package's dependencies, by name."""
    section = PROJECT.split("\ndependencies = [", 1)[1].split("]", 1)[0]
    return dict(re.findall(r'"([\w-]+)>=([\w.]+)', section))


def floors():
    """The lowest of the versions of the floor job, by name."""
    files = [(ROOT / "tests" / "constraints" / f"{name}.txt").read_text() for name in ("floor", "placo")]
    found = [pair for text in files for pair in re.findall(r"^([\w-]+)==(\S+)$", text, re.M)]
    return dict(sorted(found, key=lambda pair: [int(part) for part in pair[1].split(".")], reverse=True))


def pythons():
    """The versions of Python that classifiers name."""
    return re.findall(r'"Programming Language :: Python :: (3\.\d+)"', PROJECT)


def test_the_floor_job_has_the_lowest_versions_that_are_admitted():
    assert len(bounds()) > 10
    assert bounds().items() <= floors().items()


def test_what_is_refused_as_too_old_is_below_the_bounds():
    assert {package for package, _ in FLOORS.values()} == set(bounds())
    assert [(name, version) for name, version in FLOORS.values() if not bounds()[name].startswith(version)] == []


def test_the_hook_that_makes_kernels_takes_the_same_numba():
    hook = (ROOT / "rrtik_ompl" / "kernels" / "simd" / "hatch_build.py").read_text()
    assert f'"numba>={bounds()["numba"]}"' in hook


def test_versions_of_python_agree():
    (low,) = re.search(r'requires-python = ">=(3\.\d+)"', PROJECT).groups()
    minors = [int(version.split(".")[1]) for version in pythons()]
    assert minors == [*range(int(low.split(".")[1]), minors[-1] + 1)]
    assert f'target-version = "py{low.replace(".", "")}"' in PROJECT
    matrix = yaml.safe_load(WORKFLOWS["release"])["jobs"]["install"]["strategy"]["matrix"]
    assert matrix["python"] == [pythons()[0], pythons()[-1]]
    assert f"Python {pythons()[0]} to {pythons()[-1]}" in README
    assert "ompl>=2.0.1; python_version < '3.14'" in PROJECT


def test_the_wheel_is_installed_on_four_kinds_of_runner_before_it_is_published():
    jobs = yaml.safe_load(WORKFLOWS["release"])["jobs"]
    runners = {*jobs["install"]["strategy"]["matrix"]["runner"], jobs["conda"]["runs-on"]}
    assert len(runners) == 4
    assert {"install", "conda"} <= set(jobs["publish"]["needs"])
    assert "ref_type == 'tag'" in jobs["publish"]["if"]


@pytest.mark.parametrize("name", sorted(WORKFLOWS))
def test_the_files_that_a_workflow_names_are_there(name):
    named = set(re.findall(r"(?:tests|bench|recipe|rrtik_ompl|\.ci)/[\w./]+", WORKFLOWS[name]))
    assert [path for path in named if not (ROOT / path).exists()] == []
    assert not re.findall(r"(?<![\w.}/])/(?:tmp|work|home|opt|usr)/", WORKFLOWS[name])


@pytest.mark.parametrize("name", sorted(WORKFLOWS))
def test_actions_are_pinned_by_digest_and_a_newer_run_knows_of_an_older_one(name):
    used = re.findall(r"uses: (\S+)", WORKFLOWS[name])
    assert [action for action in used if not re.fullmatch(r"[\w./-]+@[0-9a-f]{40}", action)] == []
    assert "github.ref" in yaml.safe_load(WORKFLOWS[name])["concurrency"]["group"]


def test_the_release_runs_the_first_command_of_the_readme():
    (pattern,) = re.findall(r"sed -n 's/(\S.*)/\\1/p' README\.md", WORKFLOWS["release"])
    expression = pattern.replace("\\(", "(").replace("\\)", ")").replace("\\/", "/")
    (command,) = [match for line in README.splitlines() for match in re.findall(f"^{expression}$", line)]
    assert command.startswith(".venv/bin/rrtik plan titan4_sdu ")


def test_pictures_of_the_readme_have_addresses_that_work_anywhere_and_lead_to_files_here():
    pictures = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", README)
    address = "https://raw.githubusercontent.com/rrtik-ompl/rrtik-ompl/main/"
    assert pictures
    assert all(picture.startswith(address) for picture in pictures)
    assert all((ROOT / picture.removeprefix(address)).is_file() for picture in pictures)


def test_no_link_of_the_page_on_the_package_index_leads_nowhere():
    pattern, replacement = re.search(r"^pattern = '(.*)'\nreplacement = '(.*)'$", PROJECT, re.M).groups()
    page = re.sub(pattern, replacement, README)
    links = re.findall(r"\]\(([^)]+)\)", page)
    assert all(link.startswith(("https://", "#")) for link in links)
    assert sum("/blob/" in link for link in links) > 10


def test_the_conda_recipe_asks_for_the_same():
    assert RECIPE["context"]["version"] == rrtik_ompl.__version__
    asked = dict(re.fullmatch(r"(\S+) >=(\S+)", item).groups() for item in RECIPE["requirements"]["run"][1:])
    assert set(asked) == {CONDA_NAMES.get(name, name) for name in bounds()}
    for name, version in bounds().items():
        assert version.startswith(asked[CONDA_NAMES.get(name, name)])
