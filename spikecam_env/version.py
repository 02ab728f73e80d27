"""The package's version, written into files that it makes."""

__version__ = "0.1.0"
"""Major, minor, patch; what a rise of each means is in the changelog."""
