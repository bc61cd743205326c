"""The live page: what it shows, and the server that sends it."""
