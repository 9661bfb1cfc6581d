"""The version of the package, which its metadata take from here."""

__version__ = "0.2.0"
