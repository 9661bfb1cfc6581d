"""``python -m bench``, which `bench.runner` does."""

import sys

from bench.runner import run

if __name__ == "__main__":
    raise SystemExit(run(sys.argv[1:]))
