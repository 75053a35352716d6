"""What reads untrusted files: for each kind of file good examples, and what is done with a changed one.

A reader gets bytes in a file of its own folder, reads them by the Python API, and uses what it got as the
program would. It returns a value or raises a `WamnetError`; numbers that come out must be finite. A command
is run in this process with the changed file instead of a good one [`commands`].
"""

import io
import json
import shutil
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr, redirect_stdout, suppress
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
from mutations import HAS_ONNX
from PIL import Image, ImageCms

from wamnet.cli.commands import demo
from wamnet.cli.common import inputs as cli_inputs
from wamnet.cli.files import dataset_files, exr, images
from wamnet.cli.main import main
from wamnet.compiler import artifact, variants
from wamnet.compiler.compile import compile_program
from wamnet.compiler.core.ir import Node, Program, Type
from wamnet.compiler.core.lower import lower
from wamnet.compiler.proof import checker
from wamnet.kernels import cache
from wamnet.kernels.run import curve
from wamnet.models.importing.network import import_network
from wamnet.models.model_file import load_checkpoint, save_checkpoint, save_model
from wamnet.refimpl.errors import WamnetError
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.light import scene, variation
from wamnet.refimpl.light.render import Job, render
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.network import denoise, siren, train
from wamnet.refimpl.network.dataset import Normalization, normalization_from_json
from wamnet.refimpl.network.window import Window
from wamnet.refimpl.reading import parse_json
from wamnet.spec.conformance import case, report
from wamnet_course import frame, wire

STUDENTS = [
    json.dumps(message).encode()
    for message in (
        ["value", wire.plain((np.arange(6.0).reshape(2, 3), [np.float32(1), 2, "x"], {"a": None}, len))],
        ["value", wire.plain(Program((Node("constant", (), Type(), (("value", 1.0),)),), (("color", 0),)))],
        ["raised", [["KeyError", "LookupError"], "a message", 3]],
        ["call", wire.plain([0, np.ones(3, np.uint32)])],
    )
]
"""Messages of a student's process."""

VECTORS = Path(case.__file__).parents[1] / "vectors"
"""Where the vectors lie in a source tree; an installed package has them elsewhere."""


NETWORKS = Path(__file__).parents[1] / "models/networks"
"""Where networks of other programs are."""


class CommandRefused(WamnetError):
    """A command has ended in status 2, with one line."""


@dataclass(frozen=True)
class Target:
    """A kind of file: how it is changed [mutations.WAYS], good examples, and what is done with one.

    `slice_s`: how long it is its turn, in seconds.
    """

    name: str
    way: str
    examples: Sequence[bytes]
    use: Callable[[bytes, Path], Any]
    slice_s: float = 2.0


def finite(*arrays: Any) -> None:
    """Insist on finite numbers: what was accepted must not give others."""
    for array in arrays:
        assert np.isfinite(array).all(), "a file was accepted, and gave a number that is not finite"


class Good:
    """Good files in a folder: a tiny model, its kernel, a checkpoint, frames, a scene, a data set."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.model = tiny_model()
        save_model(folder / "model.safetensors", self.model)
        self.frame = render(canonical("minicubes"), Job(5, 4, 1, 1)).frame
        exr.write_frame(folder / "frame.exr", self.frame)
        foreign(folder / "foreign.exr", self.frame)
        images.write_png(folder / "picture.png", np.clip(self.frame["color"], 0, 1))
        profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
        Image.new("P", (5, 4)).save(folder / "palette.png", transparency=3, dpi=(72, 36), icc_profile=profile)
        recipe = replace(
            train.SHORT,
            features=("color", "depth"),
            window=Window(2),
            widths=(4,),
            steps=3,
            batch=8,
            log_every=1,
        )
        pairs = [(self.frame, self.frame)]
        save_checkpoint(folder / "trained.checkpoint.safetensors", train.train(recipe, pairs))
        artifact.write(compile_program(lower(self.model), "opencl"), folder / "kernel")
        (folder / "scene.json").write_text(scene.to_json(canonical("glossy")))
        (folder / "curve.json").write_text(json.dumps(tiny_curve(self.model)))
        (folder / "track.json").write_text(report.track_text({"random.block/1": "pass"}, []))
        dataset(folder / "set")
        (folder / "vectors").mkdir()
        for name in ("metric.mse.json", "schema.json"):
            shutil.copy(VECTORS / name, folder / "vectors" / name)
        if HAS_ONNX:
            shutil.copy(NETWORKS / "pixels.onnx", folder / "network.onnx")
        (folder / "begun").mkdir()
        (folder / "begun/plan.json").write_text(json.dumps(asdict(demo.QUICK), indent=2) + "\n")

    def read(self, name: str) -> bytes:
        """Return the content of a good file."""
        return (self.folder / name).read_bytes()


def tiny_model() -> denoise.Model:
    """Return an untrained model of two hidden layers that looks at all kinds of features."""
    features, window = ("color", "normal", "depth", "position"), Window(2)
    network = siren.init((40, 5, 4, 3), 3.0, 3.0, 3, np.float32)
    info = {
        "trained_on_scene": "minicubes",
        "trained_on_feature_spp": "16",
        "trained_on_ranges": variation.Ranges().to_json(),
        "recipe": train.recipe_to_json(train.SHORT),
    }
    return denoise.Model(network, features, window, Normalization(0.0, 9.0, (0.0, 1.0, 0.0), 3.0), info)


def tiny_curve(model: denoise.Model) -> dict[str, Any]:
    """Return a curve of two points of a model, as JSON's types."""
    numbers = (1.0, 0.1, 0.01, 0.2, float("nan"))
    points = tuple(curve.Point(name, "plain", "c", *numbers) for name in ("full", "rank1"))
    return curve.Curve(variants.digest_of(model), "a device", (4, 5), "ieee", points).as_data()


def foreign(path: Path, frame: Frame) -> None:
    """Write the colour as another program's file: two views in parts, primaries, and windows that differ."""
    planes = {name: np.ascontiguousarray(frame["color"][..., i]) for i, name in enumerate("RGB")}
    header = {"type": OpenEXR.scanlineimage, "chromaticities": (0.7, 0.3, 0.2, 0.8, 0.1, 0.1, 0.32, 0.34)}
    header["displayWindow"] = (np.array([-3, 2], np.int32), np.array([90, 40], np.int32))
    parts = [OpenEXR.Part({**header, "view": name}, dict(planes), name) for name in ("left", "right")]
    OpenEXR.File(parts).write(str(path))


def dataset(folder: Path) -> None:
    """Make the smallest data set."""
    options = ["--frames", "1", "--test", "1", "--size", "4", "--spp", "1", "--executor", "numpy"]
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        assert main(["dataset", "minicubes", *options, "-o", str(folder)]) == 0


# ---- readers ----------------------------------------------------------------------------------------------


def readers(good: Good) -> list[Target]:
    """Return all readers of the Python API."""
    model, checkpoint = good.read("model.safetensors"), good.read("trained.checkpoint.safetensors")
    kernel = good.folder / "kernel"
    certificate = (kernel / artifact.CERTIFICATE_NAME).read_bytes()
    frame, picture = good.read("frame.exr"), good.read("picture.png")
    texts = [train.recipe_to_json(train.SHORT).encode(), variation.Ranges().to_json().encode()]
    parts = json.dumps(
        {"exposure_stops": 0, "depth_scale": 1, "position_center": [0] * 3, "position_scale": 1}
    )
    scenes = [scene.to_json(canonical(name)).encode() for name in ("glossy", "cornell", "daylight")]
    vectors = [(VECTORS / name).read_bytes() for name in ("metric.mse.json", "metric.ssim.json")]
    return [
        Target("model", "safetensors", [model], partial(_model, good)),
        Target("checkpoint", "safetensors", [checkpoint], _checkpoint),
        Target("scene", "json", scenes, _scene),
        Target("curve", "json", [good.read("curve.json")], _curve),
        Target("cache", "json", [b'{"schema": "wamnet-cache-1", "sha256": "0", "data": {"a": [1]}}'], _cache),
        Target("manifest", "json", [good.read("set/manifest.json")], _manifest),
        Target(
            "certificate", "json", [certificate], partial(_certificate, kernel, artifact.CERTIFICATE_NAME)
        ),
        Target(
            "kernel",
            "json",
            [(kernel / "manifest.json").read_bytes()],
            partial(_certificate, kernel, "manifest.json"),
        ),
        Target(
            "weights",
            "bytes",
            [(kernel / "weights.bin").read_bytes()],
            partial(_certificate, kernel, "weights.bin"),
        ),
        Target("vectors", "json", vectors or [b"{}"], _vectors),
        Target("track", "json", [good.read("track.json")], _track),
        Target("answer", "json", [b'{"id": "a", "output": {"x": ["0x1p+0", 2, "nan"]}}'], _answer),
        Target("student", "json", STUDENTS, lambda message, _: _student(message)),
        Target("recipe", "json", texts[:1], lambda text, _: train.recipe_from_json(text.decode())),
        Target("ranges", "json", texts[1:], lambda text, _: variation.ranges_from_json(text.decode())),
        Target(
            "normalization", "json", [parts.encode()], lambda text, _: normalization_from_json(text.decode())
        ),
        Target("frame", "bytes", [frame, good.read("foreign.exr")], partial(_frame, good)),
        Target("picture", "bytes", [picture, good.read("palette.png")], _picture),
    ]


def _student(message: bytes) -> None:
    """Use what a student's process sends as graders do; what a check finds wrong is right."""
    kind, value = wire.read(message)
    for part in (value, kind):
        with suppress(frame.Wrong):
            frame.expect("", "a result", part, np.arange(6.0).reshape(2, 3), 1e-9)


def _file(content: bytes, folder: Path, name: str) -> Path:
    """Write a changed file and return its path."""
    path = folder / name
    path.write_bytes(content)
    return path


def _model(good: Good, content: bytes, folder: Path) -> None:
    model = cli_inputs.load_model(_file(content, folder, "model.safetensors"))
    cli_inputs.unlike_training(model, good.frame.info)
    if model.siren.widths[0] <= 4096:
        finite(denoise.denoise(model, good.frame))
        # It takes a hundred times as long as all else.
        if sum(content) % 16 == 0:
            compile_program(lower(model), "c")


def _checkpoint(content: bytes, folder: Path) -> None:
    state = load_checkpoint(_file(content, folder, "run.checkpoint.safetensors"))
    finite(*state.parameters)


def _scene(content: bytes, _folder: Path) -> None:
    found = scene.from_json(content.decode())
    scene.scene_digest(found)
    finite(*render(found, Job(2, 2, 1, 1)).frame.layers.values())


def _curve(content: bytes, folder: Path) -> None:
    found = curve.read(_file(content, folder, "curve.json"))
    curve.choose(found.points, curve.Limits(max_error=1.0))


def _cache(content: bytes, folder: Path) -> None:
    entry = cache.folder() / "fuzzed.json"
    entry.parent.mkdir(parents=True, exist_ok=True)
    entry.write_bytes(content)
    cache.read_json("fuzzed")


def _manifest(content: bytes, folder: Path) -> None:
    _file(content, folder, dataset_files.MANIFEST)
    found = dataset_files.read_manifest(folder)
    dataset_files.bytes_of(found)
    dataset_files.verify(folder, found)


def _certificate(kernel: Path, name: str, content: bytes, folder: Path) -> None:
    for file in kernel.iterdir():
        shutil.copy(file, folder / file.name)
    _file(content, folder, name)
    try:
        checker.check(folder / artifact.CERTIFICATE_NAME)
    except checker.Refused:
        return


def _vectors(content: bytes, folder: Path) -> None:
    case.load(_file(content, folder, "vectors.json"))


def _track(content: bytes, folder: Path) -> None:
    report.read_track(_file(content, folder, "track.json"))


def _answer(content: bytes, _folder: Path) -> None:
    parse_json(content, "answer", "fix it")


def _frame(good: Good, content: bytes, folder: Path) -> None:
    frame = exr.read_frame(_file(content, folder, "frame.exr"))
    if all(name in frame.layers for name in ("color", "normal", "depth", "position")) and frame.width < 200:
        finite(denoise.denoise(good.model, frame))


def _picture(content: bytes, folder: Path) -> None:
    finite(images.read_image(_file(content, folder, "picture.png")).linear)


def networks() -> list[Target]:
    """Return the import of damaged files in ONNX's form, and of other graphs beside ONNX Runtime."""
    if not HAS_ONNX:
        return []
    from beside import compared

    files = [(NETWORKS / f"{name}.onnx").read_bytes() for name in ("pixels", "sines")]
    return [Target("network", "bytes", files, _network), Target("graph", "graph", files, compared)]


def _network(content: bytes, folder: Path) -> None:
    import_network(_file(content, folder, "network.onnx"), {}, "zero")


# ---- commands ---------------------------------------------------------------------------------------------

COMMANDS: Sequence[tuple[str, str, str, str]] = (
    ("denoise, model", "safetensors", "model.safetensors", "denoise {} {good}/frame.exr -o out.exr"),
    ("denoise, frame", "bytes", "frame.exr", "denoise {good}/model.safetensors {} -o out.exr"),
    ("compile", "safetensors", "model.safetensors", "compile {} --target c -o out"),
    ("compile, curve", "json", "curve.json",
     "compile {good}/model.safetensors --target c --max-error 0.9 --curve {} -o out"),
    ("export", "safetensors", "model.safetensors", "export {} --target c -o out"),
    ("train, resumed", "safetensors", "trained.checkpoint.safetensors",
     "train -i {good}/frame.exr -t {good}/frame.exr --resume -o trained.safetensors"),
    ("import", "bytes", "network.onnx", "import {} --border zero -o out.safetensors"),
    ("render", "json", "scene.json", "render {} --width 2 --height 2 --spp 1 -o out.exr"),
    ("dataset --check", "json", "set/manifest.json", "dataset --check -o set"),
    ("compare", "bytes", "picture.png", "compare {} {good}/picture.png"),
    ("certify", "json", "kernel/denoise.certificate.json", "certify {good}/kernel-copy"),
)  # fmt: skip
"""Name, way to change, the good file that is changed, and the command; {} is the changed file."""


def commands(good: Good) -> list[Target]:
    """Return the commands that read a file, each as a target."""
    return [
        Target(f"wamnet {name}", way, [good.read(file)], partial(_command, good, file, line), 0.5)
        for name, way, file, line in COMMANDS
        if (good.folder / file).exists()
    ]


def _command(good: Good, file: str, line: str, content: bytes, folder: Path) -> None:
    """Run a command on a changed file: status 0, 1 or 2, and of 2 one line that a terminal can show."""
    path = folder / file
    if path.parent != folder:
        # What the file refers to is beside it.
        shutil.copytree(good.folder / Path(file).parent, path.parent)
    path.write_bytes(content)
    words = line.replace("{good}/kernel-copy", str(path.parent)).replace("{good}", str(good.folder)).split()
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        status = main([word.replace("{}", file) for word in words])
    assert status in (0, 1, 2), f"exit status {status}"
    said = err.getvalue()
    if status == 2:
        assert said.startswith("wamnet: error: "), f"it said {said!r}"
        assert said.count("\n") == 1, f"it said {said!r}"
    shown = (said + out.getvalue()).replace("\n", "")
    assert shown.isprintable(), f"control characters reach the terminal: {ascii(shown)[:200]}"
    if status == 0 and (folder / "out.exr").exists():
        finite(*exr.read_frame(folder / "out.exr").layers.values())
    if status == 2:
        raise CommandRefused(said)
