"""Bounds on rounding errors, and their certificates."""
