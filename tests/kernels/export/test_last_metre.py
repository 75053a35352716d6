"""What programs that nobody here wrote stumbled over: C++, two kernels in one file, macros left behind."""

import re
import shutil
import subprocess

import pytest
from kit import untrained

from wamnet.kernels.bench.workload import random_model
from wamnet.kernels.export import tools
from wamnet.kernels.export.package import Request, export
from wamnet.kernels.export.targets import TARGETS
from wamnet.refimpl.errors import ExecutorUnavailable
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.transport import Settings

SETTINGS = Settings(max_depth=1)

CALLER = """\
enum {{ PIXELS = 7, LANES = 2, WINDOW_SIZE = 3 }};
int main({taken})
{{
    {called}
    return 0;
}}
"""
"""A program with names of its own that headers use too."""


def compiled(made, folder, compiler, *options):
    """Compile a file that includes all headers of an export and names their functions; return its macros."""
    if not shutil.which(compiler):
        pytest.skip(f"{compiler} is not installed")
    heads, lines = [], []
    for name, data in made.contents().items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    for kernel in made.manifest["kernels"]:
        (header,) = kernel["files"]
        heads.append(f'#include "{header}"\n')
        lines.append(f"(void){kernel['entry_point']};")
    text = "".join(heads) + CALLER.format(taken="void", called="\n    ".join(lines))
    suffix = ".cpp" if compiler == "c++" else ".c"
    (folder / f"all{suffix}").write_text(text)
    warned = ("-Wall", "-Wextra", "-Werror", "-Wno-unused-function")
    tools.run(compiler, *options, *warned, "-c", "-o", "all.o", f"all{suffix}", folder=folder)
    command = [*tools._command(compiler), *options, "-dM", "-E", f"all{suffix}"]
    told = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout
    return set(re.findall(r"^#define (\w+)", told, re.MULTILINE))


@pytest.mark.product
@pytest.mark.needs("devices")
@pytest.mark.parametrize(("compiler", "standard"), [("cc", "-std=c99"), ("c++", "-std=c++17")])
@pytest.mark.parametrize(
    ("weights", "schedule"), [("buffer", "plain"), ("buffer", "tile:8"), ("inline", "plain")]
)
def test_all_headers_of_a_rank_are_one_file(compiler, standard, weights, schedule, tmp_path):
    """As C and as C++; no name of theirs clashes with another's or with the program's."""
    asked = {"weights": weights, "variant": "rank2", "schedule": schedule, "settings": SETTINGS}
    made = export(Request(random_model(), "c", canonical("lone_light"), **asked))
    left = compiled(made, tmp_path, compiler, standard)
    assert not left & {"restrict", "PIXELS", "LANES", "WINDOW_ROWS", "CENTRE_ROW", "MAX_DEPTH"}


@pytest.mark.needs("devices")
@pytest.mark.parametrize("schedule", ["tile:16", "tile:4", "fft:8"])
def test_each_schedule_is_cpp(schedule, tmp_path):
    """The window is one for which spectra take fewer operations."""
    model = untrained((32,), ("color",), 12)
    made = export(Request(model, "c", schedule=schedule))
    assert not compiled(made, tmp_path, "c++", "-std=c++17") & {"restrict", "PIXELS", "PLACE"}


def test_the_first_kernel_of_a_rank_has_names_of_its_own():
    """Not those of the second one, in its text, its manifest and its guard."""
    made = export(Request(random_model(), "c", variant="rank2"))
    first, second = (kernel["entry_point"] for kernel in made.manifest["kernels"])
    assert (first, second) == ("wamnet_horizontal_pixel", "wamnet_pixel")
    text = made.files["horizontal/denoise.h"].decode()
    assert "#ifndef WAMNET_HORIZONTAL_H\n" in text
    assert not re.search(r"\bwamnet_(?!horizontal_)[a-z]", text)


@pytest.mark.needs("devices")
@pytest.mark.parametrize("variant", ["full", "rank2"])
def test_buffers_of_hlsl_have_the_manifests_names(variant):
    """A host that binds by name finds each at its register, for both compilers."""
    try:
        made = export(
            Request(random_model(), "hlsl", canonical("lone_light"), variant=variant, settings=SETTINGS)
        )
    except ExecutorUnavailable as error:
        pytest.skip(str(error))
    for kernel in made.manifest["kernels"]:
        for file in kernel["files"]:
            text = made.files[file].decode()
            found = dict(re.findall(r"ByteAddressBuffer (\w+) : register\((\w+)", text))
            wanted = {b["name"]: b["slot"] for b in kernel["bindings"] if b["slot"] != "b0"}
            assert found == wanted
            assert "cbuffer" in text
            assert "sizes_width" in text


@pytest.mark.parametrize("target", [name for name, row in TARGETS.items() if not row.single])
def test_the_lines_of_integration_call_all_kernels(target):
    """In the order in which they run, each with what it is bound to; HLSL's by its registers only."""
    try:
        made = export(
            Request(random_model(), target, canonical("lone_light"), variant="rank2", settings=SETTINGS)
        )
    except ExecutorUnavailable as error:
        pytest.skip(str(error))
    code = made.files["README.md"].decode().partition("## Integration")[2].partition("Rows:")[0]
    kernels = [kernel["files"][0] for kernel in made.manifest["kernels"]]
    if target in ("opencl", "cuda"):
        kernels = kernels[:-1]  # the last one's program is the caller's
    places = [code.index(name) for name in kernels]
    assert places == sorted(places)
    assert all(f"bind_storage(pipeline, {n}," not in code for n in range(9) if target == "hlsl")
    for name in ("sums", "image_color", "image_normal", "image_horizontal", "result"):
        assert name in code


def test_godot_is_not_told_to_encode_twice():
    """A viewport with HDR 2D encodes what is encoded already."""
    made = export(Request(random_model(), "godot"))
    code = made.files["README.md"].decode().partition("## Integration")[2].partition("Rows:")[0]
    assert "use_hdr_2d = true" not in code
    assert "Leave HDR 2D off" in code
