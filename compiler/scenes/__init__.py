"""Kernels of scenes: paths, and the encoding of features."""
