"""Executors: the only modules that talk to OpenCL and OpenGL, and the NumPy one that defines the answer."""
