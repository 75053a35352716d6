"""What judges: pictures and paths compared, and what to do when they differ."""
