"""The live page: a flight in the browser while it happens."""
