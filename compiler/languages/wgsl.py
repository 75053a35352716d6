"""WGSL, the language of WebGPU: compute shaders on storage buffers, as those of GLSL for Vulkan.

Values are declared by `let`, choices are the function `select`, and there is no `precise`. The standard lets
a compiler reorder operations and round results up or down; a bound rests on one that does not [`ASSUMES`].
"""

from __future__ import annotations

from collections.abc import Sequence

from ..core.profiles import SineContract
from ..kernel.instructions import WGSL_GROUP
from ..kernel.interface import ITEMS, UNSIGNED, Interface
from .dialect import Dialect
from .glsl_buffers import GROUP, Declared

ASSUMES = (
    "the compiler keeps the order of the operations of an expression, fused or not, and rounds to nearest. "
    "The standard lets it reorder them (WGSL 15.7.5) and round up or down (15.7.2), and has no word to "
    "forbid that. Run the check pair on a new device before you rely on the bound"
)
"""What a bound rests on."""


class WGSL(Declared):
    """The dialect's table."""

    target = "wgsl"
    language = "WGSL"
    suffix = ".wgsl"
    native_sine = SineContract("sin() of WGSL, which promises 2^-11 on [-pi, pi] alone, absolutely", None)
    assumes = ASSUMES
    group_size = f"@compute @workgroup_size({GROUP[0]}, {GROUP[1]})"
    integers_block = ("struct Size {{", "    {0},", "}\n@group(0) @binding(0) var<uniform> size: Size;")
    uniform = "@group(0) @binding({number}) var<uniform> {name}: array<vec4<f32>, {array.quads}>;"
    storage = "@group(0) @binding({number}) var<storage, {access}> {name}: array<{kind}>;"
    accesses = ("read", "read_write")
    places = "@builtin(global_invocation_id) invocation: vec3<u32>"
    grouped = {
        "group_size": "@compute @workgroup_size(GROUP_WIDTH, GROUP_HEIGHT)",
        "places": "@builtin(local_invocation_id) item_place: vec3<u32>, "
        "@builtin(workgroup_id) group_place: vec3<u32>",
    }
    launching = {"group_size": f"@compute @workgroup_size({ITEMS}, 1)"}
    shared_array = "var<workgroup> {name}: array<{kind}, {count}>;"
    local_place = ("item_place.x", "item_place.y")
    group_place = ("group_place.x", "group_place.y")
    wait = "workgroupBarrier();"
    words = "dot4I8Packed, of the language feature packed_4x8_integer_dot_product"
    extensions = ("requires packed_4x8_integer_dot_product;",)
    instructions = WGSL_GROUP
    item = ("invocation.x", "invocation.y")
    size = "size."
    place_type = "i32"
    vector_kinds = {
        "float32": "vec{lanes}<f32>", "int32": "vec{lanes}<i32>", "uint32": "vec{lanes}<u32>",
        "bool": "vec{lanes}<bool>",
    }  # fmt: skip
    let = "let {name}: {kind} = {value};"
    loop = "for (var {name}: i32 = {start}; {name} < {end}; {turn}) {{"
    turn = "{name}++"
    mixed = ("var {name}: array<{kind}, {count}>;", *Dialect.mixed[1:])
    scalars = {"float32": "f32", "int32": "i32", "uint32": "u32", "bool": "bool"}
    define = "const {name}: i32 = {value};"
    table = "const {name} = array<{type}, {count}>({values});"
    operations = {**Dialect.operations, "select": "select({2}, {1}, {0})"}

    def typed(self, name: str) -> str:
        """Return the declaration of an integer, without what ends it."""
        return f"{name}: {'u32' if name in UNSIGNED else 'i32'}"

    def head(self, kernel: Interface) -> list[str]:
        """Return the lines of the function up to its brace."""
        return [self.group_size, f"fn {self.entries[kernel.role]}({self.places}) {{"]

    def function_head(self, name: str, takes: Sequence[tuple[str, str]], result: str) -> str:
        """Return the first line of a function of values."""
        return f"fn {name}({', '.join(f'{each}: {kind}' for each, kind in takes)}) -> {result} {{"

    def memory(self, kind: str, name: str, sizes: Sequence[str], value: str = "") -> str:
        """Return the declaration of an array, or of a variable."""
        for size in reversed(sizes):
            kind = f"array<{kind}, {size}>"
        return f"var {name}: {kind}{f' = {value}' if value else ''};"
