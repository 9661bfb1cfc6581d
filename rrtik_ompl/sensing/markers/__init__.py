"""Square markers: detection, corners below a pixel, poses, marker maps, sheets to print."""
