"""The moving image at the top of README.md: noisy, both denoisers, and the reference.

    python experiments/front.py -o docs/images/front.webp

1. Frames of the scene minicubes: its time runs once around, and the camera swings inside the range that the
   bundled model was trained on [`shots`]. The model was not trained on these frames.
2. Each is rendered with one path, and 16 camera rays with a shadow ray each for the features, and denoised by
   the model and by Open Image Denoise (high). That has the same features, declared clean, and in place of
   shadow rays the direct light of 16 paths in its colour; and is rendered with many paths [`panels`].
3. All are shown at the same exposure; the order of the panels is that of the caption.
"""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from lab.command import described
from lab.frames import Shot, frames, noisy, one_scattering, reference, relit
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

import wamnet
from wamnet.cli.files.outputs import replacing
from wamnet.refimpl.encoding import to_8bit, to_display
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.light.scenes import TURN_SECONDS
from wamnet.refimpl.light.variation import Variation
from wamnet_peers.peer_oidn import Kept

FRAMES, FRAME_MS, YAW_DEG = 24, 150, 12.0
"""Frames of the loop, the time that each is shown, and the largest turn of the camera."""

SIZE, REFERENCE_SPP, LABEL_PX = 320, 512, 26
"""Pixels of a panel's edge, paths per pixel of the reference, and the height of a label."""

RAYS = 16
"""Camera rays per pixel of the features, which send a shadow ray each; paths of Open Image Denoise's direct
light."""

CACHE = Path("out/lab/frames")
"""Folder of the frames."""

QUALITY = 62
"""Quality of the WebP file, which decides its size."""

LABELS = ("1 path per pixel", "wamnet", "Open Image Denoise", f"reference, {REFERENCE_SPP} paths per pixel")
"""What is above each panel."""


def shots() -> Iterator[Shot]:
    """Yield the noisy frames of the loop: each its own time and camera."""
    for step in range(FRAMES):
        phase = step / FRAMES
        look = Variation(yaw_deg=YAW_DEG * math.sin(2 * math.pi * phase))
        yield noisy(Shot("minicubes", TURN_SECONDS * phase, SIZE, 1, step, RAYS, look, shadow_rays=1))


def panels(rendered: Sequence[Frame], model: wamnet.Model, other: Kept) -> list[NDArray[np.uint8]]:
    """Return the four images of a frame, 8 bits per channel."""
    given, own, lit, clean = rendered
    ours = wamnet.denoise(model, given, executor="opencl", encoded=True)
    theirs = other(relit(given, own["color"], lit["color"])).copy()
    linear = (given["color"], theirs, clean["color"])
    first, theirs, last = (to_display(color, model.normalization.exposure_stops) for color in linear)
    return [to_8bit(image) for image in (first, ours, theirs, last)]


def sheet(images: list[NDArray[np.uint8]]) -> Image.Image:
    """Return four labelled panels in two rows."""
    cell = SIZE + LABEL_PX
    page = Image.new("RGB", (2 * SIZE + 4, 2 * cell), "white")
    pen, font = ImageDraw.Draw(page), ImageFont.load_default(16)
    for index, (image, label) in enumerate(zip(images, LABELS, strict=True)):
        left, top = (index % 2) * (SIZE + 4), (index // 2) * cell
        pen.text((left + 4, top + 3), label, "black", font)
        page.paste(Image.fromarray(image), (left, top + LABEL_PX))
    return page


def main() -> None:
    """Render and write the loop."""
    parser = described(__doc__)
    parser.add_argument("-o", "--output", type=Path, default=Path("docs/images/front.webp"))
    options = parser.parse_args()
    model, other = wamnet.load("minicubes"), Kept((SIZE, SIZE), clean=True)
    loop = list(shots())
    kinds = (loop, *zip(*(one_scattering(shot, RAYS) for shot in loop), strict=True))
    kinds = (*kinds, [reference(shot, REFERENCE_SPP) for shot in loop])
    rendered = [frames(CACHE, kind) for kind in kinds]
    pages = [sheet(panels(each, model, other)) for each in zip(*rendered, strict=True)]
    with replacing(options.output) as path:
        pages[0].save(
            path,
            "WEBP",
            save_all=True,
            append_images=pages[1:],
            duration=FRAME_MS,
            loop=0,
            quality=QUALITY,
            method=6,
        )
    print(f"{options.output}: {options.output.stat().st_size / 1e6:.2f} MB, {len(pages)} frames")


if __name__ == "__main__":
    main()
