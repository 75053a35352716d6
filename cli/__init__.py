"""The `wamnet` command: files, options, progress and reports around the reference and the executors."""
