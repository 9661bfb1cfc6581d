"""Where the tip of an arm can be, how freely it can be turned there, and how well it moves."""
