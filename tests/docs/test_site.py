"""The documentation is built as a site: no broken link, no page without a place, every public name on a page."""

import inspect
import re
import subprocess
import sys
import threading
from contextlib import closing, contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

import rrtik_ompl
from bench.page.gallery import pages
from rrtik_ompl.base.lazy import public_values
from rrtik_tests.browser import Browser
from rrtik_tests.programs import needs_chromium

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
    pages = "".join(file.read_text() for file in (site / "reference").glob("*.html"))
    titles = re.findall(r"</code>\s+rrtik\.([\w.]+)\s", pages)
    assert sorted(titles) == sorted(public_values(rrtik_ompl))


@pytest.mark.slow
def test_a_long_signature_has_a_line_for_each_argument(site):
    text = re.sub(r"<[^>]+>", "", (site / "reference" / "plan.html").read_text())
    signature = text.partition("\nplan(\n")[2].partition("\n)")[0].splitlines()
    assert [line.strip(" ,").partition(":")[0] for line in signature if ":" in line] == [
        *inspect.signature(rrtik_ompl.plan).parameters
    ]


@pytest.mark.slow
def test_the_site_names_nothing_elsewhere_to_load(site):
    loaded = re.compile(r'(?:<script[^>]*src|<img[^>]*src|<link[^>]*rel="stylesheet"[^>]*href)="(https?:[^"]*)"')
    assert [url for file in site.rglob("*.html") for url in loaded.findall(file.read_text())] == []


@pytest.mark.slow
@needs_chromium
def test_a_browser_that_shows_the_site_asks_no_other_host(site):
    with served(site) as address, closing(Browser()) as browser:
        for page in ("index.html", "reference/plan.html"):
            browser.open(address + page)
            browser.wait("document.querySelector('.md-source') !== null")
            asked = browser.ask("performance.getEntriesByType('resource').map(entry => entry.name)")
            assert asked
            assert [url for url in asked if not url.startswith(address)] == []


@contextmanager
def served(folder):
    """The address of a folder on this machine."""
    handler = partial(SimpleHTTPRequestHandler, directory=folder)
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()


def test_pages_that_plan_are_linked_where_the_workflow_publishes_them():
    url = re.search(r"^site_url: (\S+)", (ROOT / "docs/site/mkdocs.yml").read_text(), re.MULTILINE)[1]
    texts = [file.read_text() for file in (ROOT / "README.md", ROOT / "docs/pages.md")]
    linked = [name for text in texts for name in re.findall(rf"\({re.escape(url)}pages/(\w+)\.html\)", text)]
    assert len(linked) >= len(texts)
    assert set(linked) <= {name for name, _, _ in pages()}
    assert "bench gallery build/site/pages" in (ROOT / ".github/workflows/docs.yml").read_text()
