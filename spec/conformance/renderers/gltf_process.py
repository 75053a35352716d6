"""The process that renders a glTF file by Blender's importer and Cycles: SEEDS OUTPUTS SCENE SIZE SPP DEPTH.

SEEDS and OUTPUTS are lists with commas, a picture each [`forms/gltf_process.jinja`].
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from .parts import forms


def program(arguments: Sequence[str]) -> str:
    """Return the script for Blender, whose arguments are those of this process."""
    values = dict(zip(("path", "size", "spp", "depth"), arguments[2:6], strict=True))
    found: str = forms().get_template("gltf_process.jinja").render(values)
    return found


if __name__ == "__main__":
    exec(compile(program(sys.argv[1:]), "scene.py", "exec"), {"__name__": "__main__"})
