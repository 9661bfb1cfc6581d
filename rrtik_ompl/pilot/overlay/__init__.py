"""Draw the arm over a camera's picture, at its present configuration or along a path, with occlusion.

No graphics card and no window are needed: OpenCV's rasteriser turns arrays into a picture. With a virtual camera the
same code draws the view from outside.
"""
