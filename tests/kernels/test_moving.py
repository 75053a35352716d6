"""One path kernel for scenes that differ in numbers: how often it is compiled, and what it draws."""

import gc
from dataclasses import replace

import numpy as np
import pytest

from wamnet.compiler.kernel.interface import PATH
from wamnet.kernels import Pipeline, render_on
from wamnet.kernels.run.render_on import Frames
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.light import scenes
from wamnet.refimpl.light.render import Job
from wamnet.refimpl.light.transport import Settings

SETTINGS, SIZE = Settings(max_depth=2), (9, 21)
TIMES = (0.05, 0.6, 3.3, 1.7)


@pytest.fixture(scope="module")
def model(kit):
    return kit.model()


def cubes(time, **changed):
    """Return four of the mini cubes, which compile sooner, at a time; `changed` are colours of lights."""
    scene = scenes.canonical("minicubes", time=time, **changed)
    return replace(scene, boxes=scene.boxes[:4])


@pytest.fixture
def built(executor, monkeypatch):
    """Return a list that gets the path kernels that the executor compiles, and forget those of before."""
    executor.forget()
    found, prepare = [], executor._prepare

    def prepared(kernel):
        if kernel.role == PATH:
            found.append(kernel)
        return prepare(kernel)

    monkeypatch.setattr(executor, "_prepare", prepared)
    return found


def constant(executor, model, scene, seed):
    """Return the picture of a pipeline whose kernel is of constants."""
    with Pipeline(executor, scene, model, SIZE, settings=SETTINGS) as pipeline:
        assert not pipeline.path.programs.inputs
        return pipeline.run(seed)


@pytest.mark.nightly(but="numpy")
def test_scenes_that_are_named_compile_one_kernel(executor, model, built):
    """PPL-9: each picture is that of the scene's own kernel, to the bit."""
    shots = [cubes(time) for time in TIMES]
    with Pipeline(executor, shots[0], model, SIZE, settings=SETTINGS, moving=shots) as pipeline:
        found = []
        for seed, scene in enumerate(shots):
            pipeline.set_scene(scene)
            found.append(pipeline.run(seed))
        assert len(pipeline.path.programs.inputs) == 6
    assert len(built) == 1
    for seed, (scene, picture) in enumerate(zip(shots, found, strict=True)):
        assert np.array_equal(picture, constant(executor, model, scene, seed))
    assert np.abs(found[1] - found[0]).max() > 1e-3


@pytest.mark.nightly(but=("numpy", "opengl-egl"))
def test_scenes_that_were_not_named_widen_the_inputs(executor, model, built):
    """The first is constants, the second takes the rotation, the third the colours; a fourth no more."""
    shots = [cubes(0.05), cubes(0.6), cubes(3.3, warm=(0.2, 0.9, 0.4)), cubes(1.7, warm=(0.7, 0.1, 0.1))]
    counts = []
    with Pipeline(executor, shots[0], model, SIZE, settings=SETTINGS) as pipeline:
        for scene in shots:
            pipeline.set_scene(scene)
            counts.append(len(built))
        assert np.array_equal(pipeline.run(5), constant(executor, model, shots[-1], 5))
        pipeline.set_scene(shots[0])
        again = pipeline.run(6)
    assert counts == [1, 2, 3, 3]
    assert np.array_equal(again, constant(executor, model, shots[0], 6))


@pytest.mark.nightly(but=("numpy",))
def test_another_layout_is_another_kernel(executor, model, built):
    """The blocks of `glossy` are parallel to the axes at time 0, and turned at all others."""
    shots = [scenes.canonical("glossy", time=time) for time in (0.0, 0.5, 0.0, 1.5)]
    with Pipeline(executor, shots[0], model, SIZE, settings=SETTINGS, moving=shots) as pipeline:
        found = [[pipeline.set_scene(scene), pipeline.run(1)][1] for scene in shots]
    assert len(built) == 2
    assert np.array_equal(found[0], found[2])
    for scene, picture in zip(shots, found, strict=True):
        assert np.array_equal(picture, constant(executor, model, scene, 1))


def test_numbers_that_a_kernel_should_not_take_are_constants(executor, model, monkeypatch, built):
    """Where a target would make loops of the boxes, a kernel with inputs would be statements for each."""
    scene = scenes.canonical("empty")
    box = cubes(0.4).boxes[0]
    many = [
        replace(scene, boxes=tuple(replace(box, center=(0.1 * i, by, -0.1 * i)) for i in range(600)))
        for by in (0.0, 0.5)
    ]
    with Pipeline(executor, many[0], model, SIZE, settings=SETTINGS, moving=many) as pipeline:
        pipeline.set_scene(many[1])
        assert not pipeline.path.programs.inputs
    assert len(built) == 2


@pytest.mark.nightly(but="numpy")
def test_frames_of_scenes_that_are_known_share_a_kernel(executor, built):
    """Noisy picture and features of more rays have settings of their own, so two kernels in all."""
    shots = [cubes(time) for time in TIMES[:3]]
    frames, job = Frames(shots), Job(8, 6, 2, 5, SETTINGS, feature_spp=3)
    found = [render_on(executor, scene, job, frames=frames).frame for scene in shots]
    assert len(built) == 1 + (len({kernel.digest for kernel in built}) == 2)
    for scene, frame in zip(shots, found, strict=True):
        wanted = render_on(executor, scene, job).frame
        assert all(np.array_equal(frame[name], wanted[name]) for name in wanted.layers)


def test_pictures_of_a_stream_come_in_order(executor, model):
    """Each while the next one is drawn: what is yielded is not overwritten."""
    shots = [cubes(time) for time in TIMES]
    with Pipeline(executor, shots[0], model, SIZE, settings=SETTINGS, moving=shots) as pipeline:
        found = list(pipeline.stream(shots, range(len(shots)), features=("normal",)))
        for seed, (scene, drawn) in enumerate(zip(shots, found, strict=True)):
            pipeline.set_scene(scene)
            assert np.array_equal(drawn.picture, pipeline.run(seed))
            assert np.array_equal(drawn.images["normal"], pipeline.image("normal"))
        assert list(pipeline.stream([], [])) == []
        with pytest.raises(ValueError, match="shorter"):
            list(pipeline.stream(shots, [1]))


def test_an_image_that_is_read_later_is_of_its_own_picture(executor, model):
    shots = [cubes(time) for time in TIMES[:2]]
    with Pipeline(executor, shots[0], model, SIZE, settings=SETTINGS, moving=shots) as pipeline:
        with pytest.raises(InputError, match="pipeline: has rendered no image yet"):
            pipeline.later()
        pipeline.draw(1)
        first, kept = pipeline.later("normal", "color"), pipeline.image("normal")
        pipeline.set_scene(shots[1])
        pipeline.draw(2)
        assert not np.array_equal(pipeline.image("normal"), kept)
        assert np.array_equal(first().images["normal"], kept)
        with pytest.raises(InputError, match="feature image 'depth': is not one of color, normal"):
            pipeline.later("depth")


@pytest.mark.nightly
def test_an_animation_keeps_the_memory_of_its_device(executor_named, model, monkeypatch):
    """Fifty pictures: as many buffers are alive as after the second one."""
    executor = executor_named("opencl")
    module = __import__(type(executor).__module__, fromlist=["cl"])
    real, alive = module.cl.Buffer, []

    class Counted(real):
        def __init__(self, *arguments, **options):
            super().__init__(*arguments, **options)
            alive.append(1)

        def __del__(self):
            alive.pop()

    monkeypatch.setattr(module.cl, "Buffer", Counted)
    shots, counts = [cubes(0.05 + 0.1 * i) for i in range(50)], []
    with Pipeline(executor, shots[0], model, SIZE, settings=SETTINGS, moving=shots) as pipeline:
        for _ in pipeline.stream(shots, range(50)):
            gc.collect()
            counts.append(len(alive))
    assert counts[0] > 0
    assert set(counts[1:]) == {counts[1]}
