"""Commands on Blender files."""
