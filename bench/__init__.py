"""Measurements: what makes the pages in `reports`, and `rrtik_bench`, the published tables; see README.md."""
