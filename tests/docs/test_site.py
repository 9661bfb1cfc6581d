"""The documentation is built as a site: no broken link, no page without a place, every public name on a page."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import rrtik_ompl
from bench.page.gallery import pages
from rrtik_ompl.base.lazy import public_values

ROOT = Path(__file__).parents[2]
pytest.importorskip("mkdocs", reason="the extra docs needs Python 3.11")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--strict", "-f", "docs/site/mkdocs.yml", "-d"]
    found = subprocess.run([*command, str(folder)], cwd=ROOT, capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stdout + found.stderr
    return folder


@pytest.mark.slow
def test_every_public_name_is_on_a_page_of_the_reference(site):
    pages = "".join(file.read_text() for file in (site / "reference").rglob("index.html"))
    names = set(re.findall(r'id="rrtik_ompl\.[\w.]*?(\w+)"', pages))
    assert {name.split(".")[-1] for name, value in public_values(rrtik_ompl).items() if callable(value)} <= names


@pytest.mark.slow
def test_the_site_loads_nothing_from_elsewhere(site):
    loaded = re.compile(r'(?:<script[^>]*src|<img[^>]*src|<link[^>]*rel="stylesheet"[^>]*href)="(https?:[^"]*)"')
    assert [url for file in site.rglob("*.html") for url in loaded.findall(file.read_text())] == []


def test_pages_that_plan_are_linked_where_the_workflow_publishes_them():
    url = re.search(r"^site_url: (\S+)", (ROOT / "docs/site/mkdocs.yml").read_text(), re.MULTILINE)[1]
    texts = [file.read_text() for file in (ROOT / "README.md", ROOT / "docs/pages.md")]
    linked = [name for text in texts for name in re.findall(rf"\({re.escape(url)}pages/(\w+)\.html\)", text)]
    assert len(linked) >= len(texts)
    assert set(linked) <= {name for name, _, _ in pages()}
    assert "bench gallery build/site/pages" in (ROOT / ".github/workflows/docs.yml").read_text()
