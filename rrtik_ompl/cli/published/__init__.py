"""Comparisons of published tables with what is measured: as a page, and kept while a round goes on."""
