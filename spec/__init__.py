"""The parts of the spec that are installed: conformance, and the vectors. The clauses are documents."""
