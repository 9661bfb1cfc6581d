"""The command ``rrtik``: the app, the entry point, and one module a command."""
