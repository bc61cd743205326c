"""The two-point problem: what the indirect method and law `optimal` solve."""
