"""What each language looks like, for kernels of every role."""
