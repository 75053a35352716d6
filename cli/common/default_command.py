"""A command that also has commands of its own: `wamnet bench MODEL` beside `wamnet bench render`.

1. The first argument decides: one that names a command of the group runs it, and the rest is for that one.
2. All else, an option or no argument too, is for the group's own function, with all its options, arguments
   and messages: it is a command like any other. A file with the name of a command is named with its folder,
   ./render.
3. The help shows the function's options, then the commands.

Typer's groups do it the other way around: what a group does not know is refused.
"""

from typing import Any

from typer.core import TyperGroup


class CommandWithOthers(TyperGroup):
    """A group whose function takes every line that names none of its commands."""

    # As a command has them: options may be after arguments, and what is left over is refused.
    allow_extra_args = False
    allow_interspersed_args = True

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        """Return the context of the named command, or of the group's function."""
        command = self.commands.get(args[0]) if args else None
        if command is None:
            return super().make_context(info_name, args, parent, **extra)
        return command.make_context(f"{info_name} {args[0]}", args[1:], parent, **extra)
