"""Lines of a kernel's source as they are written: indentation and braces, as in all C-like languages."""

from __future__ import annotations


class Lines:
    """A writer of statements; `depth` is the number of open braces around the next line."""

    lines: list[str]
    depth: int

    def _comment(self, text: str) -> None:
        """Write a comment on a line of its own, after an empty one."""
        self.lines.append("")
        self._line(f"/* {text} */")

    def _open(self, text: str) -> None:
        """Write a line that ends in an opening brace."""
        self._line(text)
        self.depth += 1

    def _close(self, count: int = 1) -> None:
        """Write closing braces, each on a line of its own."""
        for _ in range(count):
            self.depth -= 1
            self._line("}")

    def _line(self, text: str) -> None:
        """Write a line."""
        self.lines.append("    " * self.depth + text)
