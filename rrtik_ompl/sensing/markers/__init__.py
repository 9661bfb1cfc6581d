"""Square markers: detection, corners with sub-pixel accuracy, poses, marker maps, and sheets to print."""
