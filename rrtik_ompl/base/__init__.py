"""What every room stands on: errors of one line, checked arrays, poses, units."""
