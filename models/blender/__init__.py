"""Frames of Blender files: rendered by Blender in a process of its own, over their animation."""
