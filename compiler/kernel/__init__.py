"""Kernels as data: between a program (one pixel) and its source (one language)."""
