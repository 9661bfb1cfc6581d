"""The paper as a PDF, printed by Chromium.

python docs/science/pdf.py paper.pdf
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from markdown import markdown

PAGE = Path(__file__).with_name("paper.md")
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
STYLE = """
@page { size: A4; margin: 22mm 20mm }
body { font: 10.5pt/1.42 Georgia, "Times New Roman", serif; color: #1d2733 }
h1 { font-size: 20pt } h2 { font-size: 14pt; margin-top: 1.6em } h3 { font-size: 11.5pt }
table { border-collapse: collapse; font-size: 9pt; width: 100% }
th, td { border-bottom: 0.4pt solid #8494a5; padding: 2pt 5pt; text-align: left; vertical-align: top }
tr { break-inside: avoid } h2, h3 { break-after: avoid }
pre { background: #f3f6f9; padding: 6pt } a { color: inherit; text-decoration: none }
"""


def main(target: Path) -> None:
    """Write the PDF."""
    browser = next((found for found in map(shutil.which, BROWSERS) if found), None)
    if browser is None:
        raise SystemExit(f"none of {', '.join(BROWSERS)} is on PATH: the page cannot be printed")
    body = markdown(PAGE.read_text(encoding="utf-8"), extensions=["tables", "fenced_code"])
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "paper.html"
        page.write_text(f'<!doctype html><meta charset="utf-8"><style>{STYLE}</style>{body}', encoding="utf-8")
        options = ("--headless=new", "--no-sandbox", "--no-pdf-header-footer")
        subprocess.run([browser, *options, f"--print-to-pdf={target.resolve()}", page.as_uri()], check=True)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        raise SystemExit("usage: python docs/science/pdf.py FILE.pdf")
    main(Path(sys.argv[1]))
