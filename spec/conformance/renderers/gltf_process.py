"""The process that renders a glTF file by Blender's importer and Cycles: SEEDS OUTPUTS SCENE SIZE SPP DEPTH.

1. SEEDS and OUTPUTS are lists with commas, a picture each. Settings and pictures are those of the scripts for
   Blender [write_blender.py]; surfaces, materials and the camera are what the importer makes of the file.
2. The importer turns what is up from y to z; all is turned back, so that points and normals are the file's.
3. The sky is black, for that of the file is a surface.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from .parts import script


def program(arguments: Sequence[str]) -> str:
    """Return the script for Blender, whose arguments are those of this process."""
    scene, size, spp, depth = arguments[2:6]
    lines = [
        f"bpy.ops.import_scene.gltf(filepath={scene!r})",
        "TURN = Matrix(((1, 0, 0, 0), (0, 0, 1, 0), (0, -1, 0, 0), (0, 0, 0, 1)))",
        "for made in [made for made in SCENE.objects if made.parent is None]:",
        "    made.matrix_world = TURN @ made.matrix_world",
        "SCENE.camera = next(made for made in SCENE.objects if made.type == 'CAMERA')",
        "background((0.0, 0.0, 0.0))",
        f"settings({int(size)}, {int(spp)}, {int(depth)}, True)",
    ]
    return script("blender", lines)


if __name__ == "__main__":
    exec(compile(program(sys.argv[1:]), "scene.py", "exec"), {"__name__": "__main__"})
