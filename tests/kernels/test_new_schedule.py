"""How a schedule is added: a builder that names no language, and a line for each target that has it."""

from dataclasses import replace

import numpy as np
import pytest

from wamnet.compiler import targets
from wamnet.compiler.compile import compile_program
from wamnet.compiler.kernel.interface import WEIGHTS
from wamnet.compiler.kernel.kernel import load, rewritten
from wamnet.compiler.parsing.grammar import LANGUAGES as GRAMMARS
from wamnet.compiler.parsing.parse import parse
from wamnet.compiler.plan import plan_program
from wamnet.compiler.schedules.plain import Plain
from wamnet_course.canonical import canonical


class Backwards(Plain):
    """Weights from the last one to the first: of use to no one, and different in every kernel."""

    name = "backwards"
    idea = "weights from the last one to the first"
    order = "backwards"

    def build(self, program):
        last = self.pack(program).size - 1

        def turned(value):
            args = tuple(map(turned, value.args))
            value = replace(value, args=args)
            return load(WEIGHTS, last - args[0]) if value.value == WEIGHTS else value

        kernel = super().build(program)
        return replace(kernel, body=rewritten(kernel.body, turned))

    def pack(self, program):
        return super().pack(program)[::-1].copy()


@pytest.mark.parametrize("target", ["opencl", "opengl", "c"])
def test_a_builder_and_a_line_are_all_that_a_new_schedule_needs(monkeypatch, executor_named, kit, target):
    """In each language its kernels compute what plain ones do, to the bit, within the same bound."""
    executor = executor_named("opengl-egl" if target == "opengl" else target)
    known = targets.language_named(target)
    added = replace(known, schedules={**known.schedules, "backwards": Backwards(known.dialect)})
    monkeypatch.setitem(targets.LANGUAGES, target, added)
    program = kit.denoiser(kit.network([54, 6, 3], (3.0, 3.0)), {"color": 3, "normal": 3}, 3, "clamp")
    drawn = np.random.default_rng(1).uniform(-2, 2, (2, 5, 7, 3)).astype(np.float32)
    images = dict(zip(("color", "normal"), drawn, strict=True))
    made = {name: compile_program(program, target, schedule=name) for name in ("plain", "backwards")}
    assert made["backwards"].manifest["schedule"]["name"] == "backwards"
    assert not np.array_equal(made["plain"].weights, made["backwards"].weights)
    assert kit.excess(executor, program, images, made["backwards"]) <= 1
    found = {name: executor.run(kernel, images) for name, kernel in made.items()}
    assert np.array_equal(found["plain"], found["backwards"])


@pytest.mark.parametrize("target", GRAMMARS)
def test_it_is_in_every_language_at_once(kit, target):
    """Each language's source of it is read back to its kernel, which is not the plain one."""
    dialect = targets.language_named(target).dialect
    network = kit.network([54, 6, 3], (3.0, 3.0))
    program = kit.denoiser(network, {"color": 3, "normal": 3}, 3, "clamp")
    program = plan_program(program, target).emitted
    schedule = Backwards(dialect)
    source = schedule.renderer(program, True).source(["a schedule of nobody's own"])
    channels = {"image_color": 3, "image_normal": 3, "result": 3}
    found = parse(source, target, channels)
    assert canonical(found) == canonical(schedule.kernel(program))
    assert canonical(found) != canonical(Plain(dialect).kernel(program))
