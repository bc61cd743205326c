"""Launch files, node parameters and the ares command line."""
