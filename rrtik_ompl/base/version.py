"""The version, which the package's metadata are made of."""

__version__ = "0.2.0"
