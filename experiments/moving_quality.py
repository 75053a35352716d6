"""How good whole pictures of a scene that moves are: one pipeline beside other renderers and denoisers.

    python experiments/moving_quality.py
    python experiments/moving_quality.py --peers mitsuba cycles --seeds 0

1. Moments of the mini cubes, of those that `wamnet bench pipeline` shows, none of which a network has learned
   from: their first hits are compared with those of the training frames [`shown`].
2. Every way makes its own picture of a moment, as in that benchmark: one path a pixel, of as many edges, and
   albedo and normal of that path's camera ray [`ours`, `theirs`]. Our pipeline has the network that ships,
   which has learned from features of 16 rays, and one that has learned from what a pipeline traces. The first
   is shown with features of four rays too, which a pipeline traces along with the path [`FEATURE_RAYS`].
3. Open Image Denoise gets colour, albedo and normal as they come, and once such as it has denoised first.
4. Pictures are judged display-encoded against a render of many samples. Print a Markdown table: means over
   moments and seeds with 95 % intervals, and the worst picture.

A peer that is missing has no rows; standard error says why.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path

from lab import command, intervals, scores
from lab.frames import Shot, frames, reference
from lab.sets import SETS
from quality import PLANS, ROWS, SHIPPED_SET, Bench

from wamnet.kernels import open_executor
from wamnet.kernels.bench.pipelines import PEERS, STEP_S, moments
from wamnet.kernels.run.pipeline import Pipeline
from wamnet.kernels.run.render_on import render_on
from wamnet.models.data.frame_plan import TRAIN
from wamnet.models.data.geometry import Shown, compare
from wamnet.models.model_file import load_model
from wamnet.refimpl.encoding import to_display
from wamnet.refimpl.errors import ExecutorUnavailable
from wamnet.refimpl.frame import Floats
from wamnet.refimpl.light.render import Job
from wamnet.refimpl.light.scene import Scene
from wamnet.refimpl.network.denoise import Model
from wamnet_peers import table
from wamnet_peers.moving import DENOISED, MitsubaOidn
from wamnet_peers.peer_cycles import Cycles
from wamnet_peers.peer_oidn import filtered, prefiltered

SCENE = "minicubes"
"""What moves."""

MODEL = Path(__file__).parents[1] / "models" / f"{SCENE}.safetensors"
"""The network that ships."""

EVERY, FIRST = 8, 4
"""Each so-manieth moment of the benchmark is judged, from this one on."""

REFERENCE_SEED = 9_000
"""Seed of the first reference: no way draws with it."""

NETWORKS = {
    "shipped": "the network that ships",
    "best-1": "a network that has learned from features of 1 ray",
}
"""Our networks; all but the first are rows of `quality.py`."""

FEATURE_RAYS = {"shipped": (0, 4), "best-1": (0,)}
"""Camera rays of a pixel that a network's features are means over; 0: only the path's."""

HEADS = ("image", "PSNR, dB", "worst, dB", "SSIM", "FLIP")
"""Columns of the table."""

Pictures = Mapping[str, Callable[[Scene, int], Floats]]
"""From a scene and a seed to a display-encoded picture (H, W, 3), by what a table calls it."""


def shown(chosen: Sequence[int], train: int) -> None:
    """Refuse moments that a training frame of either network shows."""
    tests = [Shown(f"moment {k}", STEP_S * (k + 0.5), moments(SCENE)[k]) for k in chosen]
    for name in (SCENE, SHIPPED_SET):
        shots = SETS[name].shots(TRAIN, SETS[name].counts(train, 0, 0), 1)
        learned = [Shown(f"training {k}", shot.time, shot.build()) for k, shot in enumerate(shots)]
        compare(learned, {"moments": tests})


def network(name: str, options: Namespace) -> Model:
    """Return a network of ours; what is to be trained is trained where the cache lacks it."""
    if name == "shipped":
        return load_model(MODEL)
    bench = Bench(SCENE, PLANS[options.scale], options.cache, options.executor)
    return bench.model(ROWS[name], 0)[0]


def ours(options: Namespace) -> Iterator[Pictures]:
    """Yield the pictures of our renderer, and of the pipeline by each network."""
    size = PLANS[options.scale].size
    with open_executor(options.executor) as device:
        yield {
            "wamnet's paths, not denoised": lambda scene, seed: to_display(
                render_on(device, scene, Job(size, size, seed=seed)).frame["color"]
            )
        }
        everything = moments(SCENE)
        for name, rays in [(each, rays) for each in options.networks for rays in FEATURE_RAYS[each]]:
            model, also = network(name, options), f", features of {rays} rays" if rays else ""
            with Pipeline(
                device, everything[0], model, (size, size), moving=everything, feature_spp=rays
            ) as pipeline:

                def picture(scene: Scene, seed: int, pipeline: Pipeline = pipeline) -> Floats:
                    pipeline.set_scene(scene)
                    return pipeline.run(seed)

                yield {f"wamnet, one pipeline, {NETWORKS[name]}{also}": picture}


def theirs(name: str, size: int) -> Iterator[Pictures]:
    """Yield the pictures of a peer by each quality; nothing, and a sentence, where it is missing."""
    try:
        maker = table.makers[name](moments(SCENE)[0], size)
    except ExecutorUnavailable as error:
        sys.stderr.write(f"no rows: {error}\n")
        return
    with closing(maker):
        if isinstance(maker, MitsubaOidn):
            yield of_mitsuba(maker)
        elif isinstance(maker, Cycles):
            yield {
                f"Cycles, {quality or 'not denoised'}": lambda scene, seed, quality=quality: to_display(
                    maker.picture(scene, seed, quality)
                )
                for quality in ("", *DENOISED)
            }


def of_mitsuba(maker: MitsubaOidn) -> Pictures:
    """Return the pictures of Mitsuba, and what Open Image Denoise makes of them."""

    def made(finish: Callable[..., Floats]) -> Callable[[Scene, int], Floats]:
        def picture(scene: Scene, seed: int) -> Floats:
            maker.show(scene)
            return to_display(finish(maker.render(seed)))

        return picture

    def by(quality: str) -> Callable[..., Floats]:
        return lambda frame: maker.denoise(frame, quality)

    best = DENOISED[-1]
    return {
        "Mitsuba 3, not denoised": made(lambda frame: frame["color"]),
        **{f"Mitsuba 3, Open Image Denoise, {quality}": made(by(quality)) for quality in DENOISED},
        f"the same, {best}, features denoised first": made(
            lambda frame: filtered(frame, prefiltered(frame, best), True, best)
        ),
    }


def every(options: Namespace) -> Iterator[Pictures]:
    """Yield ours, then those of the peers."""
    yield from ours(options)
    for name in options.peers:
        yield from theirs(name, PLANS[options.scale].size)


def rows(options: Namespace) -> Iterator[tuple[str, ...]]:
    """Yield a row for each kind of picture."""
    plan = PLANS[options.scale]
    chosen = range(FIRST, len(moments(SCENE)), EVERY)[: options.moments]
    shown(chosen, plan.train)
    shots = [Shot(SCENE, STEP_S * (k + 0.5), plan.size, seed=REFERENCE_SEED + k) for k in chosen]
    folder = options.cache / "frames"
    clean = frames(folder, [reference(shot, plan.test_spp) for shot in shots], options.executor)
    for pictures in every(options):
        for text, picture in pictures.items():
            found = [
                [
                    scores.score(picture(shot.build(), len(shots) * seed + k), target["color"])
                    for k, (shot, target) in enumerate(zip(shots, clean, strict=True))
                ]
                for seed in options.seeds
            ]
            table = {name: [[s[name] for s in line] for line in found] for name in ("psnr", "ssim", "flip")}
            told = {
                name: intervals.interval(values).text(2 if name == "psnr" else 3)
                for name, values in table.items()
            }
            worst = min(min(line) for line in table["psnr"])
            yield text, told["psnr"], f"{worst:.2f}", told["ssim"], told["flip"]


def main(arguments: Sequence[str] | None = None) -> None:
    """Render, train where a network is not there, judge, and print a line a kind of picture."""
    parser = command.parser(__doc__ or "", "moving_quality")
    parser.add_argument("--peers", nargs="*", default=["mitsuba"], choices=list(PEERS))
    parser.add_argument("--networks", nargs="+", default=list(NETWORKS), choices=list(NETWORKS))
    parser.add_argument("--moments", type=int, default=6, help="moments that are judged")
    options = parser.parse_args(arguments)
    print(f"| {' | '.join(HEADS)} |\n|{'---|' * len(HEADS)}")
    for cells in rows(options):
        print(f"| {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    command.begin(main)
