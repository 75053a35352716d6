"""How a kernel orders its work, in words of any language."""
