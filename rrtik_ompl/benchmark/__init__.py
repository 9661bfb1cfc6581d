"""Campaigns of benchmarks: suites, guarded runs, records, reports."""
