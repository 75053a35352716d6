"""Devices: one executor for NumPy, OpenCL, OpenGL and C each, and which there are here."""
