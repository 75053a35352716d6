"""The part that is read in an hour: IR, operations, tracing, interpreter, passes."""
