"""From the reference to kernels: tracing, the IR, its passes, error bounds, and each target's text."""
