"""Powered explicit guidance as compiled functions, and its lifecycle node."""
