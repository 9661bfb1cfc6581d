"""Published tables measured again: what was printed, what comes out here, and how the text was read."""
