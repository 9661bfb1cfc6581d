"""``python -m rrtik_ompl``: the command `rrtik`."""

from rrtik_ompl.cli.entry import main

if __name__ == "__main__":
    main()
