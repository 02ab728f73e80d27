"""The package's version, written into files that it makes."""

__version__ = "0.1.0"
"""Major, minor, patch; the changelog has the meaning of a rise of each."""
