"""The arm drawn over a camera's picture, now or later along a path, hidden by what is in front of it.

No graphics card and no window are needed: arrays in, a picture out, by OpenCV's rasteriser. With a virtual camera the
same drawing is the view from outside.
"""
