"""The shipped suites of benchmarks: one YAML file each, whose first lines say what it is for and how long it takes."""

from pathlib import Path

FOLDER = Path(__file__).parent
