"""The commands below `wamnet bench`: each measures one part, and prints a Markdown table of it."""
