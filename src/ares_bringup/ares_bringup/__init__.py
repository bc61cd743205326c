"""Launch files, node parameters and the ares command line."""

__version__ = "0.1.0"
