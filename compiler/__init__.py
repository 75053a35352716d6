"""From the reference to kernels: tracing, the IR and its passes, error bounds, and the text for each target."""
