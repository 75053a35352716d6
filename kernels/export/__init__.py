"""Kernels for other programs: what is written for them, and what runs it here, to hold it to its bound."""
