"""How fast searches, checks and whole processes are, and how good the covers are."""
