"""The executable specification: every algorithm of wamnet in its plainest form, in NumPy only."""
