"""The command line. Each command ends with one of these exit codes."""

FOUND = 0  # or valid, or done
NOT_FOUND = 1  # or not valid
BAD_INPUT = 2
INTERRUPTED = 130
