"""The shipped problems: one YAML file each, whose first lines say where its numbers come from."""

from pathlib import Path

FOLDER = Path(__file__).parent
