"""What a target's language looks like in a path kernel: the words of the skeleton, beside those of Dialect.

emit_path.py fills the templates in. Names in braces: `entry`, `lanes`, `max_depth`, `tables` and `outputs`
of the whole kernel, `value` of a number that is the same in all lanes, `mask` of a truth value, `plane` the
number of a plane of sums, `output` and `component` the place of a plane where outputs hold several.
`uniforms` are the texts of the numbers that all lanes share, `scene_numbers` declares those of the scene
that are inputs (`vectors` of four) and `scene_number` reads one; a language without them takes no moving
scene; `helpers` the functions that an operation's template calls, by operation: a kernel without the
operation lacks them. A kernel follows `lanes` paths at once; in a language with vectors a value then has
one component a lane.
"""

from __future__ import annotations

from collections.abc import Mapping

from .dialect import Dialect


class PathDialect(Dialect):
    """One language and schedule; a subclass sets every attribute that has no value here."""

    entry = "wamnet_trace"
    suffix: str
    lanes = 1
    path_begin: str
    path_end: str
    path_arguments: str
    bounces = "for (uint bounce = 0u; bounce <= MAX_DEPTH; ++bounce) {"
    splat = "{value}"
    any_lane = "{mask}"
    lane_numbers: str
    helpers: Mapping[str, str] = {}
    uniforms: Mapping[str, str]
    scene_numbers = ""
    scene_number = ""
    scalar_float: str
    output_declaration: str
    planes_per_output = 1
    max_planes: int
    sum_store: str
