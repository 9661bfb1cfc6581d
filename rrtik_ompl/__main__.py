"""``python -m rrtik_ompl``: the command `rrtik`."""

from rrtik_ompl.command import main

if __name__ == "__main__":
    main()
