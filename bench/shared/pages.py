"""Where the pages are that the scripts write."""

from __future__ import annotations

import argparse
from pathlib import Path

REPORTS = Path(__file__).resolve().parent.parent / "reports"


def add_out(parser: argparse.ArgumentParser, page: str, text: str = "the page") -> None:
    """``--out`` of a script that writes this page of `bench/reports`."""
    parser.add_argument("--out", type=Path, default=REPORTS / page, help=text)
