"""A training step as a kernel."""
