"""Measurements: scripts that write the pages in `reports`, and `rrtik_bench`, the published tables; see README.md."""
