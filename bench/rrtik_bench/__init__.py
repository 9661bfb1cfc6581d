"""Published tables measured again: what was printed, what comes out here, and how the text was read.

One module or folder a publication; `registry` lists their tables, and `rrtik reproduce` finds them there. `report` is
the writer of pages that the reports of `bench` use too.
"""
