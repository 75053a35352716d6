"""Sources read back to kernels."""
