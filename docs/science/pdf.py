"""The paper as a PDF, printed by Chromium, or as one HTML file with its figures inside.

python docs/science/pdf.py paper.pdf
python docs/science/pdf.py paper.html
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from base64 import b64encode
from pathlib import Path

from markdown import markdown

PAGE = Path(__file__).with_name("paper.md")
TITLE = "Three works on robot arms, measured again"
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
STYLE = """
@page { size: A4; margin: 22mm 20mm }
body { font: 10.5pt/1.42 Georgia, "Times New Roman", serif; color: #1d2733 }
h1 { font-size: 20pt } h2 { font-size: 14pt; margin-top: 1.6em } h3 { font-size: 11.5pt }
table { border-collapse: collapse; font-size: 9pt; width: 100% }
th, td { border-bottom: 0.4pt solid #8494a5; padding: 2pt 5pt; text-align: left; vertical-align: top }
tr { break-inside: avoid } h2, h3 { break-after: avoid }
img { max-width: 100%; max-height: 110mm; display: block; margin: 6pt auto }
pre { background: #f3f6f9; padding: 6pt } a { color: inherit; text-decoration: none }
"""


def page() -> str:
    """The paper as one HTML page."""
    body = markdown(PAGE.read_text(encoding="utf-8"), extensions=["tables", "fenced_code"])
    body = re.sub(r'src="(figures/[^"]+\.png)"', lambda found: f'src="{_inside(found[1])}"', body)
    return f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{TITLE}</title><style>{STYLE}</style>{body}'


def _inside(figure: str) -> str:
    """A picture as an address that holds it."""
    return "data:image/png;base64," + b64encode((PAGE.parent / figure).read_bytes()).decode("ascii")


def main(target: Path) -> None:
    """Write the page, or print it."""
    if target.suffix == ".html":
        target.write_text(page(), encoding="utf-8")
        return

    browser = next((found for found in map(shutil.which, BROWSERS) if found), None)
    if browser is None:
        raise SystemExit(f"none of {', '.join(BROWSERS)} is on PATH: the page cannot be printed")

    with tempfile.TemporaryDirectory() as folder:
        html = Path(folder) / "paper.html"
        html.write_text(page(), encoding="utf-8")
        options = ("--headless=new", "--no-sandbox", "--no-pdf-header-footer")
        subprocess.run([browser, *options, f"--print-to-pdf={target.resolve()}", html.as_uri()], check=True)


if __name__ == "__main__":
    if len(sys.argv) != 2 or Path(sys.argv[1]).suffix not in (".pdf", ".html"):
        raise SystemExit("usage: python docs/science/pdf.py FILE.pdf or FILE.html")
    main(Path(sys.argv[1]))
