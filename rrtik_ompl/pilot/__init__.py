"""The human-in-the-loop tool: a pilot decides, the machine shows what will happen and refuses what must not.

Everything that matters happens in `Session`, without a page: a script can drive it as well as a browser.
"""
