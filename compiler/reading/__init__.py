"""The text of a kernel, read without the compiler, and held against its certificate.

What it proves and how: spec/text.md.
"""
