"""The command that verifies renderers."""
