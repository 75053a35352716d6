"""Commands on networks of other programs."""
