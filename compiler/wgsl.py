"""WGSL, the language of WebGPU: compute shaders on storage buffers, as those of GLSL for Vulkan.

Values are declared by `let`, choices are the function `select`, and there is no `precise`: the standard lets
a compiler reorder a sum only where the result is at least as accurate, and a bound rests on that.
"""

from __future__ import annotations

from .dialect import Dialect
from .encode_dialect import EncodeDialect
from .glsl_buffers import BUFFERS, FIRST_IMAGE, GROUP, GROUPS
from .path_dialect import PathDialect
from .profiles import SineContract

ASSUMES = (
    "the compiler keeps the order of the operations of an expression, fused or not, or does better: the "
    "standard asks for as much, and has no word to demand more. Run the check pair on a new device"
)
"""What a bound rests on."""

SIZE = """\
struct Size {{
    width: i32,
    height: i32,
{more}}}
@group(0) @binding(0) var<uniform> size: Size;
"""
"""The uniform buffer of the sizes."""

PIXEL = f"""\
@compute @workgroup_size({GROUP[0]}, {GROUP[1]})
fn main(@builtin(global_invocation_id) invocation: vec3<u32>) {{{{
    let width: i32 = size.width;
    let height: i32 = size.height;
    let x: i32 = i32(invocation.x);
    let y: i32 = i32(invocation.y);
    if (x >= width || y >= height) {{{{
        return;
    }}}}"""
"""The start of the denoiser and of the encoding."""


def sized(*more: str) -> str:
    """Return the uniform buffer with further numbers."""
    return SIZE.replace("{more}", "".join(f"    {text},\n" for text in more))


def storage(binding: str, access: str, name: str, of: str = "f32") -> str:
    """Return the declaration of a storage buffer."""
    return f"@group(0) @binding({binding}) var<storage, {access}> {name}: array<{of}>;"


class _WGSL(Dialect):
    """What the three kernels have in common."""

    target = "wgsl"
    language = "WGSL"
    suffix = ".wgsl"
    entry = "main"
    native_sine = SineContract("sin() of WGSL, which promises 2^-11 on [-pi, pi] alone, absolutely", None)
    assumes = ASSUMES
    types = {"float32": "f32", "int32": "i32", "uint32": "u32", "bool": "bool"}
    magnitude = "abs({0})"
    counted = "for (var {i}: i32 = 0; {i} < {count}; {i}++) {{"
    define = "const {name}: i32 = {value};"
    choice = "select({2}, {1}, {0})"
    max_output_channels = 2**16
    table = "const {name} = array<{type}, {count}>({values});"
    operations = {
        **Dialect.operations,
        "absolute": "abs({0})",
        "minimum": "min({0}, {1})",
        "maximum": "max({0}, {1})",
        "convert": "{type}({0})",
        "select": choice,
    }

    def let(self, dtype: str, name: str, value: str, kept: bool = False) -> str:
        """Return the declaration of a value."""
        return f"let {name}: {self.types[dtype]} = {value};"

    def var(self, dtype: str, name: str, value: str = "", kept: bool = False) -> str:
        """Return the declaration of a variable that is assigned later, or again."""
        return f"var {name}: {self.types[dtype]}{f' = {value}' if value else ''};"

    def array(self, dtype: str, name: str, count: int, kept: bool = False) -> str:
        """Return the declaration of an array."""
        return f"var {name}: array<{self.types[dtype]}, {count}>;"

    def single(self, name: str, value: str) -> str:
        """Return the declaration of one number."""
        return self.let("float32", name, value)

    def index(self, name: str, value: str) -> str:
        """Return the declaration of a place in an image or a window."""
        return self.let("int32", name, value)


class WGSL(_WGSL):
    """The dialect's table for denoisers."""

    first_binding = FIRST_IMAGE
    image_declaration = storage("{binding}", "read", "image_{image}")
    image_separator = "\n"
    begin = f"""\
{{defines}}
{sized()}{storage("1", "read", "weights")}
{storage("2", "read_write", "result")}
{{images}}

{PIXEL}"""
    pixel = "image_{image}[(row * width + column) * {channels} + c]"
    weight = "weights[{index}]"
    store = "result[(y * width + x) * {channels} + {i}] = {value};"
    arguments = (
        f"{BUFFERS.format(sizes='width, height')}"
        "1 the weights, 2 the result (width * height * {channels} floats, encoded as `output` says), 3 and\n"
        f"on the images in this order. {GROUPS.format(rows='height')}"
    )


class WGSLPath(_WGSL, PathDialect):
    """The dialect's table for paths."""

    entry = "main"
    lane_numbers = "0u"
    bounces = "for (var bounce: u32 = 0u; bounce <= MAX_DEPTH; bounce++) {"
    path_begin = f"""\
const MAX_DEPTH: u32 = {{max_depth}}u; /* scatterings of a path */
{sized("first_row: i32", "rows: i32", "first_sample: u32", "samples: i32", "seed_number: u32")}{
        storage("2", "read_write", "sums")
    }
{{tables}}

@compute @workgroup_size({GROUP[0]}, {GROUP[1]})
fn main(@builtin(global_invocation_id) invocation: vec3<u32>) {{{{
    let width: i32 = size.width;
    let samples: i32 = size.samples;
    let column: i32 = i32(invocation.x);
    let row: i32 = i32(invocation.y);
    if (column >= width || row >= size.rows) {{{{
        return;
    }}}}
    let plane: i32 = size.rows * width;
    let at: i32 = row * width + column;
    let x: {{counter}} = {{column}} + {{lane_numbers}};
    let y: {{counter}} = {{row}};
    let seed: {{counter}} = {{seed}};"""
    path_end = "}}"
    uniforms = {
        "column": "u32(column)",
        "row": "u32(row + size.first_row)",
        "seed": "size.seed_number",
        "width": "f32(width)",
        "height": "f32(size.height)",
        "sample": "size.first_sample + u32(n)",
    }
    scalar_float = "f32({0})"
    output_declaration = ""
    sum_store = "sums[{plane} * plane + at] = {value};"
    max_planes = 2**16
    path_arguments = (
        f"{BUFFERS.format(sizes='width, height, first_row, rows, first_sample, samples, seed_number')}"
        "2 the sums, one plane of rows * width floats for each of:\n"
        "{planes}.\n"
        f"{GROUPS.format(rows='rows')}; invocation (x, y) follows pixel x of row first_row + y"
    )


class WGSLEncode(_WGSL, EncodeDialect):
    """The dialect's table for encodings."""

    entry = "main"
    encode_begin = f"""\
{sized("sample_count: i32")}{storage("1", "read", "sums")}
{{outputs}}

{PIXEL}
    let plane: i32 = width * height;
    let at: i32 = y * width + x;
    let samples: f32 = f32(size.sample_count);"""
    encode_end = "}}"
    input_declaration = ""
    output_declaration = storage("{binding}", "read_write", "image_{image}")
    output_separator = "\n"
    load = "let {name}: f32 = sums[{plane} * plane + at];"
    image_store = "image_{image}[at * {channels} + {channel}] = {value};"
    planes_per_input = 1
    encode_arguments = (
        f"{BUFFERS.format(sizes='width, height, sample_count')}"
        "1 the sums, one plane of width * height floats for each of:\n"
        "{planes};\n"
        f"3 and on the images in this order. {GROUPS.format(rows='height')}"
    )
