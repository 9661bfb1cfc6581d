"""The arm drawn over a camera's picture, as it stands or as it will: with what hides it, by OpenCV's rasteriser.

No graphics card, no window: arrays in, a picture out. The same drawing from an eye of one's own choice is the
God's-eye view.
"""
