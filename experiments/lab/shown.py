"""What texts show of the records: tables, figures in sentences, and plots, by name.

1. A table is a function of the records in `TABLES` [`lab/texts.py`]; most are made by [`study`], from the
   columns that the record names, or by [`as_printed`], from what a program has printed. Records of decided
   questions may hold what is shown of them [`decided`]; the commit that they name has the code.
2. A figure that is computed from several values is a function in `FIGURES`; one that is a value needs none.
3. Plots are in lab/gallery.py.
"""

import importlib
import statistics
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

from wamnet.refimpl.errors import InputError

from . import paper, printed, support, tables
from .intervals import paired
from .records import Records
from .results import PER_FRAME, Results, number
from .speeds import TableOf, speed_against_error, speed_short
from .tables import Column


def study(name: str, first: str = "") -> TableOf:
    """Return the table of a study: all its configurations, under the columns of its record [`intervals`]."""

    def made(records: Records) -> str:
        shown = [Column(*column) for column in records[name].data()["columns"]]
        return tables.table(records[name], intervals(records[name], shown), first=first)

    return made


def intervals(found: Results, columns: Sequence[Column]) -> list[Column]:
    """Return columns with intervals in place of deviations where the numbers of each pose were kept."""
    kept = {value for record in found.records() for value in record["values"].get(PER_FRAME, {})}
    return [replace(column, interval=True) if column.value in kept else column for column in columns]


def as_printed(record: str, number: int | None = None, without: Collection[str] = ()) -> TableOf:
    """Return a table as a program has printed it; all of them as one without a number."""
    return lambda records: printed.table(records[record], number, without)


DECIDED = {
    **{name: name for name in ("blender", "claims", "departures", "domain", "generalisation", "house3")},
    **{name: name for name in ("same-bits", "sines", "sines-every")},
    **{f"departures-{name}": "departures" for name in ("clip", "loss", "replacement")},
    "claims-exposures": "claims",
    "learning-curve": "learning_curve",
}
"""Tables and figures of decided questions, and the records that have them as they were shown."""


def decided(name: str) -> TableOf:
    """Return a table or a figure of a decided question."""
    return lambda records: str(records[DECIDED[name]].data()["shown"][name])


def whole_pictures(records: Records) -> str:
    """Return whole pictures of all sizes, and the parts and other ways of the largest."""
    rows = [record["values"] for record in records["bench-pipeline"].records()]
    largest = max((row["size"] for row in rows), key=lambda size: int(size.partition("x")[0]))
    whole = ("one pipeline, moving", "whole picture")
    return printed.table(
        records["bench-pipeline"],
        shows=lambda row: row["size"] == largest or row["method"].startswith(whole),
    )


TIMES = ("s", "ms", "schedule")
"""Columns of programs that measure quality, whose times say nothing: other work ran beside them."""


# ---- the presets beside Open Image Denoise --------------------------------------------------------------

QUALITY = (
    Column("psnr", "PSNR, dB", 2),
    Column("ssim", "SSIM", 3),
    Column("flip", "FLIP", 3),
    Column("spp", "equivalent spp", 0),
)
"""Columns of the scores of pictures."""


def quality(name: str, split: str = "test", only: Sequence[str] = (), record: str = "quality") -> TableOf:
    """Return the rows of a set's frames, inside its ranges or outside; all rows unless some are named."""

    def made(records: Records) -> str:
        module, found = importlib.import_module("quality"), records[record]
        texts = {module.configuration(name, split, row): module.ROWS[row].text for row in only or module.ROWS}
        shown = {key: text for key, text in texts.items() if found.summary(key, "psnr")}
        if not shown:
            raise InputError(
                f"record {record}", f"{name}, {split}", "has no rows of these frames", "make them"
            )
        columns = [column for column in QUALITY if any(found.summary(key, column.value) for key in shown)]
        return tables.table(found, intervals(found, columns), shown)

    return made


JUDGED = ("hard-light", "quality")
"""Records of quality.py: a row of ours is in one of them, with what it is compared with."""


def ahead(
    name: str, split: str = "test", ours: str = "best-16", value: str = "psnr", digits: int = 1
) -> TableOf:
    """Return by how much a row of `quality` is ahead of Open Image Denoise with the same features.

    That is the one with clean features, of rays that are spread as the row's are; where a row sees past
    mirrors and glass, the best one that does.
    """

    def made(records: Records) -> str:
        module = importlib.import_module("quality")
        row, own = module.ROWS[ours], module.configuration(name, split, ours)
        found = next(records[key] for key in JUDGED if records[key].summary(own, value))
        peer = "oidn-shadows16" if row.shadow_rays else "oidn-clean16"
        peer = "oidn-past-prefiltered16" if row.past else peer
        one, other = (found.per_pose(module.configuration(name, split, row), value) for row in (ours, peer))
        # One seed of ours is compared with the same seed of the other: its noise is the same.
        return paired(one, other[: len(one)]).text(digits)

    return made


_HARD = "input oidn-past-prefiltered16 oidn-past-apart16 hard-16 smooth-16 lit-16 sun-16 sun48-16"
HARD_OUTSIDE = tuple(_HARD.split())
"""Rows that are shown of frames outside of the ranges of hard scenes."""
README_ROWS = ("input", "oidn-color", "oidn-prefiltered1", "oidn-clean16", "best-16", "page-16", "page48-16")
"""Rows of `quality` that the README shows."""

AHEAD = (
    ("minicubes", "best-16", "`minicubes`, preset `best`"),
    ("minicubes", "page-16", "`minicubes`, inputs and steps of the web page"),
    ("minicubes", "page48-16", "the same, 48 neurons per layer"),
    ("minicubes-page", "shipped", "`minicubes`, any front camera, any light hue; inputs of the web page"),
    ("minicubes-page", "smooth-page-16", "the same cameras and lights, filtered colour"),
    ("minicubes-page", "shipped-shadows", "the same, shadow rays instead: the bundled `minicubes`"),
    ("cornell", "best-16", "`cornell`, preset `best`"),
    ("cornell", "shadows-16", "`cornell`, shadow rays: the bundled model"),
    ("glossy", "five-shadows-16", "`glossy`, shadow rays, specular features for both: the bundled model"),
    ("glossy", "lit-16", "`glossy`, preset `mirrors`; both get specular features"),
    ("daylight", "sun-16", "`daylight`, preset `sky`; both get specular features"),
)
"""Sets and rows that docs/results.md compares with Open Image Denoise, given the same features."""


def differences(records: Records) -> str:
    """Return how far rows are ahead of Open Image Denoise: PSNR inside and outside, SSIM, FLIP."""
    cells = []
    for name, ours, text in AHEAD:
        made = [ahead(name, split, ours, value, digits) for split, value, digits in GAPS]
        cells.append([text, *(one(records) for one in made)])
    heads = ["", "PSNR inside, dB", "PSNR outside, dB", "SSIM inside", "FLIP inside (lower is better)"]
    return tables.markdown(heads, cells)


GAPS = (("test", "psnr", 2), ("outside", "psnr", 2), ("test", "ssim", 3), ("test", "flip", 3))
"""The differences that are shown: split, score, digits."""


def frame_ms(row: str, record: str = "quality-times") -> Callable[[Records], str]:
    """Return the median milliseconds of a frame by a row of `quality`."""

    def made(records: Records) -> str:
        times = records[record].of("times", "seconds")[0]
        return f"{1000.0 * statistics.median(times[row]):.0f}"

    return made


def quality_times(records: Records) -> str:
    """Return the times of a frame, medians and ranges of turns."""
    seconds = records["quality-times"].of("times", "seconds")[0]
    cells = [
        [name, f"{1000 * statistics.median(s):.1f}", f"{1000 * min(s):.1f} - {1000 * max(s):.1f}"]
        for name, s in seconds.items()
    ]
    return tables.markdown(["a frame, interleaved", "ms, median", "ms, range"], cells)


# ---- speed ----------------------------------------------------------------------------------------------


BENCH = {
    "opencl:fft:16": "OpenCL, PoCL, `fft:16`: first layer by FFT",
    "opencl:tile:16": "OpenCL, PoCL, `tile:16`: register tiles",
    "opencl:plain": "OpenCL, PoCL, `plain`: the human-readable kernel",
    "opengl:inlined": "OpenGL, llvmpipe, `inlined`",
    "torch.compile": "`torch.compile`",
    "torch": "PyTorch, eager",
    "onnxruntime": "ONNX Runtime",
    "oidn:fast": "Open Image Denoise, fast (another network)",
    "oidn:high": "Open Image Denoise, high",
    "c:tile:16": "C, GCC, `tile:16`",
    "opencl:dot:16:whole8": "OpenCL, PoCL, integers, `dot:16`: byte products",
    "c:dot:16:whole8": "C, GCC, integers, `dot:16`",
    "onnxruntime:int8": "ONNX Runtime, 8 bits",
    "openvino:int8": "OpenVINO, 8 bits",
}  # contenders of `wamnet bench` that a page shows, with their names there


def bench(record: str) -> TableOf:
    """Return the contenders of [`BENCH`], the fastest first."""
    heads = ("ms, median", "spread", "frames/s", "compile, s", "largest error", "bound of rounding")
    keys = ("ms.median", "ms.spread", "frames_per_s", "compile_s", "error.max", "rounding.bound")
    forms = dict(zip(keys, (",.0f", ".0%", ".1f", ".1f", ".1e", ".1e"), strict=True))

    def made(records: Records) -> str:
        rows = {
            r["configuration"]: r["values"] for r in records[record].records() if r["configuration"] in BENCH
        }
        ordered = sorted(rows.items(), key=lambda item: item[1]["ms.median"])
        cells = [[BENCH[name], *(_short(row, key, forms[key]) for key in keys)] for name, row in ordered]
        return tables.markdown(["backend", *heads], cells)

    return made


def _short(row: Mapping[str, Any], key: str, form: str) -> str:
    """Return a number of a row, or a dash."""
    return "-" if row.get(key) is None else format(row[key], form)


def train_speed(records: Records) -> str:
    """Return the time of a step and of all steps by each trainer, both presets side by side."""
    found, names = (
        records["bench-train"],
        {"numpy": "the reference, NumPy", "torch": "PyTorch", "opencl": "compiled"},
    )
    rows: dict[str, list[str]] = {}
    heads = ["backend"]
    for at, preset in ((1, "paper"), (2, "short")):
        mine = [r["values"] for r in found.records() if r["values"]["table"] == at]
        steps = list(mine[0])[-1]
        heads += [f"`{preset}`, ms per step", f"all {steps}"]
        for row in mine:
            rows.setdefault(names[row["backend"]], []).extend([row["ms per step"], row[steps]])
    return tables.markdown(heads, [[name, *row] for name, row in rows.items()])


def paper_hours(records: Records) -> str:
    """Return the hours of the paper's data set, 1,100 frames of 2^20 pixels and 1,024 samples, by OpenCL."""
    rows = [r["values"] for r in records["bench-render-kernels"].records()]
    (speed,) = (number(row["samples/s"]) for row in rows if row["backend"].startswith("opencl"))
    return f"{1100 * 2**20 * 1024 / speed / 3600:.0f}"


def moving(by: str, way: str, column: str, digits: int) -> Callable[[Records], str]:
    """Return what the pipeline's table says of a way of whole pictures of 512x512."""

    def made(records: Records) -> str:
        rows = [r["values"] for r in records["bench-pipeline"].records()]
        (found,) = (
            r for r in rows if (r.get("backend"), r.get("method"), r.get("size")) == (by, way, "512x512")
        )
        return f"{number(found[column]):.{digits}f}"

    return made


def languages(records: Records) -> str:
    """Return the kernels of each language on a processor, the fastest first: time, bound and compilation."""
    rows = [r["values"] | {"name": r["configuration"].split(",")[0]} for r in records["languages"].records()]
    found = sorted((row for row in rows if "ms" in row), key=lambda row: row["ms"])
    cells = [
        [
            row["name"],
            f"`{row['schedule']}`",
            f"{row['ms']:,.0f}",
            f"{row['ms'] / found[0]['ms']:.1f}",
            f"{row['bound']:.1e}",
            f"{row['share']:.2g}",
            "yes" if row["read"] else "no",
            f"{row['first_s']:.1f}",
        ]
        for row in found
    ]
    heads = (
        "language",
        "schedule",
        "ms",
        "ratio",
        "bound",
        "share of the bound",
        "source read",
        "first frame, s",
    )
    return tables.markdown(heads, cells)


# ---- the demonstration ----------------------------------------------------------------------------------


def demo_pictures(records: Records) -> str:
    """Return the scores of the demonstration's unseen frames."""
    columns = [
        Column("mse", "MSE", 5),
        Column("psnr", "PSNR, dB", 1),
        Column("ssim", "SSIM", 3),
        Column("relmse", "relMSE", 4),
        Column("smape", "SMAPE", 3),
    ]
    found = records["demo"]
    names = {name: name for name in found.configurations() if name.endswith(" s")}
    return tables.table(found, columns, names, "`make demo`")


def demo_runs(records: Records) -> str:
    """Return the executors of the demonstration."""
    columns = [
        Column("seconds_run", "time, s", 3),
        Column("error", "largest error against float64", write=lambda s: f"{s.mean:.1e}"),
        Column("bound_frame", "proven bound, this frame", write=lambda s: f"{s.mean:.1e}"),
    ]
    found = records["demo"]
    names = {name: name for name in found.configurations() if found.summary(name, "seconds_run")}
    return tables.table(found, columns, names, "executor")


FIGURES: Mapping[str, Callable[[Records], str]] = {
    "ahead-of-oidn": ahead("minicubes", ours="page-16"),
    "ahead-of-oidn-lamps": ahead("minicubes-page", ours="shipped"),
    "ahead-of-oidn-outside": ahead("minicubes", "outside", ours="page-16"),
    **{name: decided(name) for name in DECIDED if name.startswith("departures-")},
    "hard-ms": frame_ms("lit-16", "hard-light-times"),
    "hard-oidn-ms": frame_ms("oidn-past-prefiltered16", "hard-light-times"),
    "hard-oidn-clean-ms": frame_ms("oidn-past-clean16", "hard-light-times"),
    "sky-ms": frame_ms("sun-16", "hard-light-times"),
    "moving-mitsuba": moving("mitsuba", "whole picture, denoised fast", "times opencl, moving", 1),
    "moving-ms": moving("opencl", "one pipeline, moving", "ms, median", 0),
    "oidn-fast-ms": frame_ms("oidn-fast16"),
    "oidn-high-ms": frame_ms("oidn-clean16"),
    "page-ms": frame_ms("page-16"),
    "paper-hours": paper_hours,
}
"""Figures in sentences that are computed from several values."""
RESULTS = ("detected", "missed", "unreached", "stale")
"""What comes of a planted fault (tests/planted/plant.py)."""


def planted_faults(records: Records) -> str:
    """Return how many planted faults of each package the tests detect, and how many a golden file."""
    counts: dict[str, Counter[str]] = {}
    for values in (record["values"] for record in records["planted-faults"].records()):
        package = "/".join(values["file"].split("/")[:-1][:2])
        for name in (package, "all"):
            counts.setdefault(name, Counter()).update([values["result"], values["how"], "faults"])
    order = [*sorted(set(counts) - {"all"}), "all"]
    cells = [[n, *(str(counts[n][key]) for key in ("faults", *RESULTS, "golden"))] for n in order]
    return tables.markdown(["package", "faults", *RESULTS, "by a golden file"], cells)


IN_SHADOW = ("cornell", "glossy", "vitrine", "daylight", "outside", "outside-96", "paths")
"""Tables of shadow rays in other sets than the mini cubes, with more paths, and outside."""

AS_PRINTED = (
    "bench-primitives", "bench-render", "bench-render-kernels", "certified", "exports", "feature-rays",
    "course", "gpu-pipeline", "moving-quality", "savings", "shadows", "shadows-few",
    "shadows-times", "sines-speed", "specialisation", "text-faults", "whole",
)  # fmt: skip
"""Records that are shown as their command has printed them."""
TABLES: Mapping[str, TableOf] = {
    **{name: as_printed(name) for name in AS_PRINTED},
    **{name: decided(name) for name in DECIDED if not name.startswith("departures-")},
    "bench-pipeline": whole_pictures,
    "bench-c-pipeline": as_printed("bench-c-pipeline"),
    "ablations": study("ablations", "all else as `short`"),
    **{name: bench(name) for name in ("bench-integers", "bench-paper")},
    "bench-train-paper": as_printed("bench-train", 1),
    "bench-train-short": as_printed("bench-train", 2),
    **{name: as_printed(name, 1) for name in ("reference-mutants", "c99-mutants")},
    "held-back-left": as_printed("held-back", 2),
    **{f"held-back-{n}-left": as_printed(f"held-back-{n}", 2) for n in ("second", "third", "fourth")},
    "gpu": lambda records: importlib.import_module("gpu").rows(records["gpu"]),
    "sequence": as_printed("sequence", 2),
    "sequence-frame": as_printed("sequence", 1),
    "demo-pictures": demo_pictures,
    "demo-runs": demo_runs,
    "fig-prediction": study("fig_prediction"),
    **{name: study(name) for name in ("flicker", "lights")},
    "heads": study("heads", "camera moves"),
    "history": study("history", "`minicubes`, 24 pictures a second"),
    "lamps": study("lamps", "`minicubes`, camera at rest"),
    "languages": languages,
    "losses": study("losses", "loss"),
    "planted-faults": planted_faults,
    "presets": as_printed("presets", without=TIMES),
    "quality-ahead": differences,
    "quality-lamps": quality("minicubes-page"),
    **{f"quality-{name}": quality(name) for name in ("cornell", "glossy", "minicubes")},
    **{
        f"hard-{name}": quality(name, record="hard-light")
        for name in ("glossy", "daylight", "minicubes-page")
    },
    "hard-glossy-outside": quality("glossy", "outside", HARD_OUTSIDE, "hard-light"),
    "hard-daylight-outside": quality("daylight", "outside", HARD_OUTSIDE, "hard-light"),
    "hard-vitrine": quality("vitrine", record="hard-light-vitrine"),
    "hard-vitrine-outside": quality("vitrine", "outside", record="hard-light-vitrine"),
    "quality-outside": quality("minicubes", "outside"),
    "quality-readme": quality("minicubes", only=README_ROWS),
    "quality-times": quality_times,
    "ranks": as_printed("ranks", without=TIMES),
    **{f"shadows-{name}": as_printed(f"shadows-{name}", without=("ms",)) for name in IN_SHADOW},
    "shadows-bundled": as_printed("shadows-bundled", without=(*TIMES, "PSNR, range of seeds")),
    **{f"verified{end}": as_printed("verified", table) for end, table in {"": 1, "-deviations": 2}.items()},
    "sines-octaves": as_printed("sines", 2),
    "speed-against-error": speed_against_error("bench-minicubes"),
    "speed-short": speed_short("bench-minicubes"),
    "support": support.matrix,
    "table1": paper.table1,
    "table1-readme": paper.table1_readme,
    "train-speed": train_speed,
    "variants": as_printed("variants", without=TIMES),
}
"""The tables by name."""
