"""Foundations of all packages: errors of one line, validated arrays, poses, units."""
