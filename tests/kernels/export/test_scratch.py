"""Kernels in C on small stacks: the header states enough, and scratch memory replaces a thread's stack."""

import re
import shutil
import subprocess

import pytest
from kit import untrained

from wamnet.compiler.languages.c import stack_bytes
from wamnet.kernels.export import tools
from wamnet.kernels.export.hosts.headers import stack_of
from wamnet.kernels.export.package import Request, export

SCHEDULES = ("plain", "tile:16", "fft:16")

CALLER = """\
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "scratch.h"

enum { WIDTH = 50, HEIGHT = 30, CHANNELS = 8, COUNT = WIDTH * HEIGHT };
static float image[COUNT * CHANNELS], weights[1 << 21], result[COUNT * 3], expected[COUNT * 3];

static void *small(void *given)
{
    void *memory = malloc(wamnet_scratch_bytes());
    int *errors = (int *)given;
    errors[0] = wamnet_image_with(ARGUMENTS, memory, wamnet_scratch_bytes() - 1);
    errors[1] = result[0] != 0.0f;
    errors[2] = wamnet_image_with(ARGUMENTS, memory, wamnet_scratch_bytes());
    free(memory);
    return 0;
}

int main(void)
{
    pthread_attr_t attributes;
    pthread_t thread;
    int errors[3] = {0, 0, 0};
    for (int i = 0; i < COUNT * CHANNELS; ++i) image[i] = (float)(i % 97) / 97.0f;
    for (int i = 0; i < 1 << 21; ++i) weights[i] = (float)(i % 89 - 44) / 4400.0f;
    pthread_attr_init(&attributes);
    pthread_attr_setstacksize(&attributes, 128 * 1024);
    pthread_create(&thread, &attributes, small, errors);
    pthread_join(thread, 0);
    memcpy(expected, result, sizeof result);
    wamnet_image(ARGUMENTS);
    printf("%d %d %d %d", errors[0] == EINVAL, errors[1], errors[2], memcmp(expected, result, sizeof result));
    return 0;
}
"""
"""A thread of 128 KiB calls with too little memory and with enough; then the main thread calls directly."""


def written(folder, schedule):
    """Write the C denoiser of a model whose window is large enough for spectra; return its export."""
    made = export(Request(untrained((32, 32), size=12), "c", schedule=schedule))
    for name, data in made.contents().items():
        if name.startswith("denoise/"):
            (folder / name.removeprefix("denoise/")).write_bytes(data)
    return made


@pytest.mark.nightly("fft:16")
@pytest.mark.needs("devices")
@pytest.mark.parametrize("schedule", SCHEDULES)
def test_a_thread_of_128_kib_denoises_in_scratch_memory(tmp_path, schedule):
    made = written(tmp_path, schedule)
    images = ["image"] * len(made.denoiser.programs.gather.images)
    arguments = ", ".join([*images, "weights", "result", "WIDTH", "HEIGHT"])
    (tmp_path / "caller.c").write_text(f"#define ARGUMENTS {arguments}\n{CALLER}")
    warned = ("-Wall", "-Wextra", "-Werror", "-Wno-unused-function")
    tools.run("cc", "-O1", *warned, "-o", "caller", "caller.c", "-lm", "-pthread", folder=tmp_path)
    told = subprocess.run([tmp_path / "caller"], capture_output=True, text=True, check=True).stdout
    assert told == "1 0 0 0"


@pytest.mark.nightly("fft:16-gcc", "fft:16-clang")
@pytest.mark.needs("devices")
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize("schedule", SCHEDULES)
def test_no_call_takes_more_stack_than_its_header_states(tmp_path, schedule, compiler):
    if not shutil.which(compiler):
        pytest.skip(f"{compiler} is not installed")
    made = written(tmp_path, schedule)
    stated = int(re.search(r"stack: (\d+) bytes", made.denoiser.source)[1])
    assert f"up to {stated:,} bytes" in made.contents()["README.md"].decode()
    assert stated == stack_bytes(made.denoiser.manifest["private_bytes"]) == stack_of(made.denoiser)
    (tmp_path / "one.c").write_text('#include "denoise.h"\nvoid *one = (void *)wamnet_image;\n')
    for options in (("-O0",), ("-O2",)):
        tools.run(compiler, *options, "-w", "-fstack-usage", "-c", "one.c", folder=tmp_path)
        frames = {}
        for line in (tmp_path / "one.su").read_text().splitlines():
            function, size, _ = line.split("\t")
            # A program runs one clone of a function: that for its processor.
            key = re.sub(r"[.]arch_\w+", "", function)
            frames[key] = max(frames.get(key, 0), int(size))
        # No function calls deeper than image, pixel, transform: all frames together are more than any path.
        assert 0 < sum(frames.values()) <= stated, options
