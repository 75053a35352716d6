"""Light: cameras, shapes, materials, sampling and the path tracer."""
