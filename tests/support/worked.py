"""The worked examples of the spec: functions that compute, from the reference, what a chapter shows.

1. A chapter holds `<!-- worked: name -->`, the lines, `<!-- end -->`; comments are not seen where it is read.
2. `LINES[name]()` gives the lines; `tests/meta/test_spec_examples.py` compares, and writes them with a flag.

Floats that are stated to the bit are written as C's `%a` does; others are float64, rounded to seven
significant digits, in which the sines and powers of different machines agree. Differences of nearly equal
numbers are not shown.
"""

import json
import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from wamnet.compiler.compile import compile_program
from wamnet.compiler.core import sine
from wamnet.compiler.core.lower import lower
from wamnet.compiler.scenes.encode_kernel import compile_encode
from wamnet.compiler.scenes.lower_scene import lower_scene
from wamnet.compiler.scenes.path_kernel import compile_path
from wamnet.compiler.training.step_kernel import compile_step
from wamnet.refimpl import encoding, metrics, rng
from wamnet.refimpl.light import (
    camera,
    intersection,
    render,
    sampling,
    scene,
    scenes,
    shading,
    sobol,
    transport,
)
from wamnet.refimpl.network import adam, dataset, factored, siren, train
from wamnet.refimpl.network.denoise import Model
from wamnet.refimpl.network.window import Window, windows_at
from wamnet.spec.conformance.numbers import number_text

SEED, SAMPLE, X, Y, SIZE_PX = 7, 5, 6, 10, 16
"""The path that several chapters follow: sample 5 of pixel (6, 10) of a picture of 16 x 16, seed 7."""

SPEC = Path(__file__).resolve().parents[2] / "spec"
"""The chapters, whose decisions are an appendix."""

LINES: dict[str, Callable[[], list[str]]] = {}
"""The examples by name."""


def worked(function: Callable[[], list[str]]) -> Callable[[], list[str]]:
    """Register an example under its function's name."""
    LINES[function.__name__] = function
    return function


# ---- forms ----------------------------------------------------------------------------------------------


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Return the lines of a Markdown table."""
    return [f"| {' | '.join(row)} |" for row in (header, ["---"] * len(header), *rows)]


def short(value: Any) -> str:
    """Return a number, or the numbers of a vector, with seven significant digits."""
    numbers = np.ravel(np.asarray(value, np.float64))
    return ", ".join(f"{float(f'{x:.7g}') + 0.0:.7g}" for x in numbers)


def exact(value: Any) -> str:
    """Return floats as C's `%a` writes them."""
    return ", ".join(number_text(float(x)) for x in np.ravel(value))


def word(value: Any) -> str:
    """Return 32-bit words in hexadecimal."""
    return ", ".join(f"0x{int(x):08x}" for x in np.ravel(value))


# ---- random numbers -------------------------------------------------------------------------------------


@worked
def random_block() -> list[str]:
    """PCG4D step by step: block 1 of the path that the chapters follow."""
    v = [X + (Y << 16), SAMPLE, 1, SEED]
    steps = [("pixel, sample, block, seed", v)]
    v = [(1664525 * word_ + 1013904223) % 2**32 for word_ in v]
    steps.append(("1664525 v + 1013904223", v))
    for name in ("products added", "products added again"):
        if name == "products added again":
            v = [word_ ^ (word_ >> 16) for word_ in v]
            steps.append(("v xor (v >> 16)", v))
        for i, j, k in ((0, 1, 3), (1, 2, 0), (2, 0, 1), (3, 1, 2)):
            v = [*v[:i], (v[i] + v[j] * v[k]) % 2**32, *v[i + 1 :]]
        steps.append((name, v))
    found = rng.random_block(*(rng.counter(n) for n in (SEED, X + (Y << 16), SAMPLE, 1)))
    assert [int(word_[0]) for word_ in found] == v, "the example is the reference's arithmetic"
    floats = [rng.uniform_floats(word_, np.float64)[0] for word_ in found]
    rows = [[name, *(word(w) for w in words)] for name, words in steps]
    return table(("", "x", "y", "z", "w"), [*rows, ["floats", *(exact(f) for f in floats)]])


@worked
def sobol_points() -> list[str]:
    """Direction numbers, and the first points of a block."""
    rows = [[str(d), word(sobol.DIRECTIONS[d][:6])] for d in range(4)]
    lines = table(("dimension", "v_0, v_1, ..., v_5"), rows)
    n = rng.counter(np.arange(4))
    counters = [np.broadcast_to(rng.counter(value), n.shape) for value in (SEED, X + (Y << 16))]
    block = np.broadcast_to(rng.counter(1), n.shape)
    point = np.stack([sobol.sobol(n, d) for d in range(4)], axis=-1)
    floats = np.stack(sobol.uniforms(*counters, n, block, np.float64), axis=-1)
    rows = [[str(i), word(point[i]), exact(floats[i])] for i in range(4)]
    shown = table(("n", "point n, not scrambled", "numbers of sample n"), rows)
    key = rng.counter(0x12345678)
    mixed = [word(sobol.scramble(rng.counter(x), key)) for x in (0, 1, 0x80000000)]
    scrambled = f"Scrambled with the key 0x12345678, 0, 1 and 2^31 become {', '.join(mixed)}."
    return [*lines, "", *shown, "", scrambled]


# ---- one path -------------------------------------------------------------------------------------------


def _counters() -> transport.Counters:
    """Return the counters of the path that the chapters follow."""
    return transport.Counters(*(rng.counter(n) for n in (SEED, X + (Y << 16), SAMPLE)))


def _camera() -> tuple[camera.CameraBasis, transport.World]:
    """Return camera and constants of `cornell` in float64."""
    cornell = scenes.canonical("cornell")
    return camera.camera_basis(cornell.camera), transport.build(cornell, transport.Settings(), np.float64)


def _start(basis: camera.CameraBasis) -> transport.Path:
    """Return the path at the camera."""
    x, y, size = np.array([float(X)]), np.array([float(Y)]), float(SIZE_PX)
    return render.start(basis, x, y, size, size, _counters(), np.float64)


@worked
def camera_ray() -> list[str]:
    """The camera of `cornell` and one ray of it."""
    basis, _ = _camera()
    u, v, _, _ = rng.uniforms(*_counters(), rng.counter(0), np.float64)
    image = ((2.0 * (X + u) - SIZE_PX) / SIZE_PX, (SIZE_PX - 2.0 * (Y + v)) / SIZE_PX)
    path = _start(basis)
    rows = [
        ["right, up', forward", "; ".join(short(a) for a in (basis.right, basis.up, basis.forward))],
        ["tan(fov/2)", short(basis.tan_half_fov)],
        ["u, v", f"{exact(u)}, {exact(v)}"],
        ["X, Y", ", ".join(short(part * basis.tan_half_fov) for part in image)],
        ["origin", short(path.origin)],
        ["direction", short(path.direction)],
    ]
    return table(("", "value"), rows)


@worked
def path_vertex() -> list[str]:
    """The first vertex of the same path: hit, light sample, next direction."""
    basis, world = _camera()
    path, surface, hit = transport.arrive(world, _start(basis))
    assert world.lights is not None
    pick, u0, u1, _ = rng.uniforms(*_counters(), rng.counter(1), np.float64)
    v0, v1, _, _ = rng.uniforms(*_counters(), rng.counter(2), np.float64)
    origin = intersection.spawn_origin(surface.point, surface.normal, hit.t)
    site = shading.site(world.materials, surface, hit, path.direction, path.beta)
    way = transport._towards(world, site, origin, pick, u0, u1)
    other = shading.pdf(world.materials, site, hit, way.wi, way.cos_surface)
    weight = transport.mis_weight(world.settings, way.divisor, other)
    color, light = transport.direct_light(world, site, hit, origin, pick, u0, u1)
    after, alive = transport.scatter(world, path, surface, hit, rng.counter(0), _counters())
    assert alive.all(), "the example's path continues"
    assert np.all(light > 0), "the example's light sample is visible"
    local = sampling.sample_cosine_hemisphere(v0, v1)
    rows = [
        ["surface, t", f"{int(hit.surface[0])}, {short(hit.t)}", "ISC-1"],
        ["point p", short(surface.point), "ISC-8"],
        ["normal n; reflectance", f"{short(surface.normal)}; {short(surface.reflectance)}", "ISC-8"],
        ["shadow ray's origin", short(origin), "ISC-9"],
        ["light's u0, u1 of block 1", f"{exact(u0)}, {exact(u1)}", "RNG-7"],
        ["wi; distance s", f"{short(way.wi)}; {short(way.distance)}", "LTR-3"],
        ["cos_s, cos_l", f"{short(way.cos_surface)}, {short(way.cos_light)}", "LTR-3"],
        ["density of the light sample", short(way.divisor), "LTR-3"],
        ["radiance L of the light", short(way.radiance), "SCN-5"],
        ["density of wi by the surface", short(other), "LAM-1"],
        ["weight (power heuristic)", short(weight), "LTR-5"],
        ["added to the radiance", short(color * light), "LTR-4"],
        ["u0, u1 of block 2", f"{exact(v0)}, {exact(v1)}", "RNG-7"],
        ["local direction", short(local), "SMP-2"],
        ["next direction", short(after.direction), "SMP-6"],
        ["beta; density of the direction", f"{short(after.beta)}; {short(after.pdf)}", "LTR-7"],
    ]
    return table(("", "value", "clause"), rows)


@worked
def canonical_json() -> list[str]:
    """The canonical line of a scene, and its digest."""
    empty = scenes.canonical("empty")
    plain = scene._plain(empty)
    del plain["info"]
    line = scene.json.dumps(plain, allow_nan=False)
    return ["```json", line, "```", "", f"Its digest is `{scene.scene_digest(empty)}`."]


@worked
def canonical_digests() -> list[str]:
    """Digests of the canonical scenes at two times."""
    rows = [
        [f"`{name}`", *(f"`{scene.scene_digest(scenes.canonical(name, time=t))}`" for t in (0.0, 1.25))]
        for name in scenes.CANONICAL
    ]
    return table(("scene", "digest at 0 s", "digest at 1.25 s"), rows)


# ---- what the network sees and learns -------------------------------------------------------------------


@worked
def display_values() -> list[str]:
    """Linear values and their display encodings."""
    linear = np.array([-0.5, 0.0, 0.001, 0.0031308, 0.18, 0.5, 1.0, 4.0])
    encoded = encoding.to_display(linear)
    rows = [[short(x), short(v), str(int(encoding.to_8bit(v)))] for x, v in zip(linear, encoded, strict=True)]
    return table(("linear", "display-encoded (ENC-5)", "8 bits (ENC-7)"), rows)


@worked
def window_at_border() -> list[str]:
    """The window of 4 x 4 of the top left pixel under both border rules."""
    image = (10.0 * np.arange(3)[:, None] + np.arange(5))[..., None]
    lines = ["```text", f"{'image':<22} {'clamp':<18} zero"]
    clamp, zero = (
        windows_at(image, [0], [0], Window(4, border)).reshape(4, 4) for border in ("clamp", "zero")
    )
    for row in range(4):
        left = "  ".join(f"{v:2.0f}" for v in image[row, :, 0]) if row < 3 else " " * 18
        parts = ["  ".join(f"{v:2.0f}" for v in w[row]) for w in (clamp, zero)]
        lines.append(f"{left} {parts[0]:>18} {parts[1]:>18}")
    return [*lines, "```"]


@worked
def drawn_pixels() -> list[str]:
    """The first draws of a stream."""
    frame, y, x = dataset.sample_pixels(SEED, 4, 4, [(16, 16), (8, 32)])
    index = dataset.sample_indices(SEED, 4, dataset.PIXEL_TAG, 4, 512)
    words = rng.random_block(*(rng.counter(n) for n in (SEED, 0, 4, dataset.PIXEL_TAG)))
    rows = [[str(i), word(words[i]), *(str(int(part[i])) for part in (index, frame, y, x))] for i in range(4)]
    return table(("i", "word w", "floor(512 w / 2^32)", "frame", "y", "x"), rows)


@worked
def first_weights() -> list[str]:
    """The first initial parameters of the paper's network."""
    network = siren.init(train.PAPER.layer_widths, 1.0, 1.0, SEED)
    rows = [
        [f"layer {layer}", exact(network.weights[layer].ravel()[:3]), exact(network.biases[layer][:2])]
        for layer in (0, 1, 4)
    ]
    return table(("", "first three weights", "first two biases"), rows)


@worked
def small_network() -> list[str]:
    """A network of 2-2-1 forwards and backwards."""
    weights = (np.array([[0.5, -1.0], [0.25, 0.75]]), np.array([[1.5, -0.5]]))
    network = siren.Siren(weights, (np.array([0.125, -0.25]), np.array([0.0625])), 3.0, 1.0)
    x, target = np.array([[0.2, -0.4]]), np.array([[0.25]])
    y, cache = siren.forward_cached(network, x)
    loss, slopes = train.loss_and_gradients(network, x, target)
    rows = [
        ["W x + b of layer 0", short(cache.angles[0] / 3.0)],
        ["sin(3 (W x + b))", short(cache.inputs[1])],
        ["y", short(y)],
        ["loss against 0.25", short(loss)],
        ["dW, db of layer 1", f"{short(slopes.dweights[1])}; {short(slopes.dbiases[1])}"],
        ["dW (rows), db of layer 0", f"{short(slopes.dweights[0])}; {short(slopes.dbiases[0])}"],
    ]
    return table(("", "value"), rows)


@worked
def adam_steps() -> list[str]:
    """Three steps of one parameter."""
    theta, state = (np.array([0.5]),), adam.init((np.array([0.5]),))
    rows = []
    for g in (0.1, -0.02, 0.0):
        theta, state = adam.step(theta, (np.array([g]),), state, 0.001)
        grown = adam.growth(state.t)
        m_hat, v_hat = state.m[0] / grown[0], state.v[0] / grown[1]
        values = (g, state.m[0], state.v[0], m_hat, v_hat)
        rows.append([str(state.t), *map(short, values), f"{float(theta[0][0]):.9f}"])
    return table(("t", "g", "m", "v", "m/(1 - beta_1^t)", "v/(1 - beta_2^t)", "theta"), rows)


@worked
def low_rank() -> list[str]:
    """A matrix of rank 1 as factors, with its window's order."""
    factors = factored.Factors(np.array([[[2.0], [3.0]]]), np.array([[5.0, 7.0]]))
    weights = factored.expand(factors)
    return [
        "Example: one neuron, a window of 2 x 2, one channel, V = (2, 3) down the rows, H = (5, 7)",
        f"along them: the weights, in the order of a window vector, are {short(weights)}.",
    ]


@worked
def ssim_window() -> list[str]:
    """SSIM of one window."""
    row, column = np.divmod(np.arange(121.0), 11)
    r = ((row + column) / 20).reshape(11, 11, 1)
    x = np.minimum(r * 0.5 + 0.25, 0.6)
    bell = np.exp(-0.5 * (np.arange(-5, 6) / metrics.WINDOW_SIGMA_PX) ** 2)
    weight = np.outer(bell, bell)[..., None] / bell.sum() ** 2
    m_x, m_r = ((weight * image).sum() for image in (x, r))
    v_x, v_r, c = (
        (weight * a * b).sum() - m_a * m_b
        for a, b, m_a, m_b in ((x, x, m_x, m_x), (r, r, m_r, m_r), (x, r, m_x, m_r))
    )
    rows = [
        ["weights of a row, over the middle one", short(bell[:6])],
        ["weight of the middle pixel", short(weight[5, 5])],
        ["m_x, m_r", f"{short(m_x)}, {short(m_r)}"],
        ["v_x, v_r, c", ", ".join(f"{value:.5g}" for value in (v_x, v_r, c))],
        ["SSIM", f"{metrics.ssim(x, r):.6f}"],
        ["MSE; PSNR", f"{metrics.mse(x, r):.6f}; {metrics.psnr(x, r):.4f} dB"],
        ["relMSE; SMAPE", f"{metrics.relmse(x, r):.6f}; {metrics.smape(x, r):.6f}"],
    ]
    return table(("", "value"), rows)


# ---- kernels --------------------------------------------------------------------------------------------


@worked
def sine_constants() -> list[str]:
    """The constants of the reduction."""
    return table(
        ("constant", "float32, as C's `%a`"),
        [["1/pi", exact(sine.INVERSE_PI)], ["P1, P2, P3", exact(sine.PI_PARTS)]],
    )


@worked
def sine_coefficients() -> list[str]:
    """The coefficients by degree."""
    rows = [[str(degree), exact(p.coefficients)] for degree, p in sine.POLYNOMIALS.items()]
    return table(("degree", "c1, c3, ..., as C's `%a`"), rows)


@worked
def sine_steps() -> list[str]:
    """The sine of three numbers, each step in float32."""
    columns = []
    for value in (2.5, 100.0, -12345.678):
        x = np.array([value], np.float32)
        k = np.floor(x * np.float32(sine.INVERSE_PI) + np.float32(0.5))
        parts = [np.float32(part) for part in sine.PI_PARTS]
        first = x - k * parts[0]
        r = sine.reduce(x, k)
        sign = 1.0 - 2.0 * (k - 2.0 * np.floor(0.5 * k))
        reduced = [exact(x), short(k), exact(first), exact(r), short(sign)]
        found = [exact(sine.polynomial(r, 11)), exact(sine.sine(x, 11)), short(np.sin(np.float64(x)))]
        columns.append([*reduced, *found])
    names = ("x", "k", "x - k P1", "r", "sign", "p(r), degree 11", "result", "sin(x), exact")
    return table(("", "first", "second", "third"), [[n, *c] for n, *c in zip(names, *columns, strict=True)])


def _small_model() -> Model:
    """Return a model of colour and normal, of 2 x 2 pixels and four neurons."""
    features, window = ("color", "normal"), Window(2, "clamp")
    network = siren.init((dataset.n_inputs(features, window), 4, 3), 1.0, 1.0, SEED)
    return Model(network, features, window, dataset.Normalization())


def signature(source: str, language: str) -> list[str]:
    """Return what a caller binds, as the source declares it, in a fence."""
    if language == "glsl":
        declared = re.findall(r"(?m)^(?:uniform|layout).*;$", source)
    else:
        declared = re.findall(r"(?ms)^(?:__kernel|static inline) void wamnet_\w+\(.*?\)", source)
        declared = [re.sub(r"\n +", "\n    ", text) for text in dict.fromkeys(declared)]
    return [f"```{language}", *declared, "```"]


@worked
def denoise_bindings() -> list[str]:
    """What each target's plain kernel, and the compute shader, ask for."""
    program = lower(_small_model())
    kinds = (
        ("opencl", "plain", "c"),
        ("opengl", "plain", "glsl"),
        ("opengl", "group:1", "glsl"),
        ("c", "plain", "c"),
    )
    lines: list[str] = []
    for target, schedule, language in kinds:
        made = compile_program(program, target, schedule)
        lines += ["", f"{made.manifest['language']}, `{schedule}`:", "", *signature(made.source, language)]
    return lines[1:]


@worked
def path_bindings() -> list[str]:
    """What a path kernel asks for."""
    programs = lower_scene(scenes.canonical("furnace"), transport.Settings(max_depth=3))
    lines: list[str] = []
    for target, language in (("opencl", "c"), ("opengl", "glsl")):
        made = compile_path(programs, target, 1)
        lines += ["", f"{made.manifest['language']}:", "", *signature(made.source, language)]
    planes = ", ".join(f"`{plane}`" for plane in made.planes)
    return [*lines[1:], "", f"Planes of a frame, in order: {planes}."]


@worked
def encode_bindings() -> list[str]:
    """What the encoding of colour and depth asks for."""
    lines: list[str] = []
    for target, language in (("opencl", "c"), ("opengl", "glsl")):
        made = compile_encode(("color", "depth"), dataset.Normalization(), target)
        lines += ["", f"{made.manifest['language']}:", "", *signature(made.source, language)]
    return lines[1:]


@worked
def train_bindings() -> list[str]:
    """What the kernels of a step ask for."""
    source = compile_step((12, 20, 3), (1.0, 1.0), 32, 2).source
    found = [
        re.sub(r"\n +", "\n    ", match)
        for match in re.findall(r"(?ms)^__kernel void wamnet_\w+\(.*?\)", source)
    ]
    return ["```c", *found, "```"]


@worked
def denoise_manifest() -> list[str]:
    """A manifest, with hashes left out."""
    made = compile_program(lower(_small_model()), "opencl", "plain")
    text = json.dumps(made.manifest, indent=1, sort_keys=True)
    text = re.sub(r"[0-9a-f]{64}", "64 hexadecimal digits", text)
    for _ in range(2):  # Lists and objects of numbers and texts on one line.
        text = re.sub(
            r"([\[{])\n *([^\[\]{}]{0,90}?)\n *([\]}])",
            lambda m: m[1] + re.sub(r"\n *", " ", m[2]) + m[3],
            text,
        )
    return ["```json", *text.splitlines(), "```"]


# ---- the appendix ---------------------------------------------------------------------------------------


@worked
def table_1() -> list[str]:
    """The paper's Table 1 with both logarithms."""
    printed = {
        "input": (82.93, 66.67),
        "DnCNN": (79.03, 67.16),
        "WAMnet": (48.04, 72.17),
        "pix2pix": (39.28, 74.18),
    }
    rows = []
    for name, (mse, psnr) in printed.items():
        ratio = 255.0**2 / mse
        assert abs(10 * np.log(ratio) - psnr) <= 0.07, "the spec says that all rows fit to 0.07"
        found = (f"{10 * f(ratio):.2f}" for f in (np.log, np.log10))
        rows.append([name, f"{mse}", f"{psnr}", *found, f"{mse / 255.0**2:.6f}"])
    header = ("", "MSE", "PSNR as printed", "10 ln(255^2/MSE)", "decibels", "MSE in [0, 1]")
    return table(header, rows)


def decided() -> list[tuple[str, str, str]]:
    """Return (chapter, clause before it or "", text) of every decision."""
    found = []
    for path in sorted(SPEC.glob("*.md")):
        clause = ""
        for paragraph in path.read_text().split("\n\n"):
            clause = (re.findall(r"^\*\*([A-Z0-9]+-\d+[a-z]?)\*\*", paragraph, re.MULTILINE) or [clause])[-1]
            if paragraph.lstrip("\n").startswith("> Decision: "):
                lines = " ".join(line.removeprefix(">").strip() for line in paragraph.strip().splitlines())
                found.append((path.name, clause, lines.removeprefix("Decision: ")))
    return found


def opening(text: str) -> str:
    """Return a text's first sentences, so many that they say something, as a cell of a table."""
    # What is written from records, a table or a figure between marks, is the chapter's.
    before = re.sub(r"<!--.*?-->", "", text.partition("<!-- table:")[0]).strip()
    sentences = re.split(r"(?<=\.) ", before)
    count = next((n for n in range(1, len(sentences)) if len(" ".join(sentences[:n])) >= 60), len(sentences))
    return " ".join(sentences[:count]).removesuffix(":").replace("|", "\\|")


@worked
def decisions() -> list[str]:
    """All decisions of the chapters, with links."""
    rows = [[f"[{clause}]({name})", opening(text)] for name, clause, text in decided()]
    return table(("clause", "decision"), rows)


@worked
def sine_errors() -> list[str]:
    """The proven errors by degree (SIN-6)."""
    rows = [
        [str(degree), *(f"{e:.3g}" for e in (p.approximation_error, p.error, p.cosine_error))]
        for degree, p in sine.POLYNOMIALS.items()
    ]
    return table(("degree", "of the polynomial", "of the sine", "of the cosine"), rows)
