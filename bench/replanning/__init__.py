"""DRRT-Con among moving obstacles."""
