"""Films from pictures: MP4 through ffmpeg, GIF through Pillow.

A film is written from files of one size, one at a time, all of it or nothing [`write_movie`].
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from ...refimpl.errors import InputError
from ..common.packages import need
from .outputs import replacing

MOST_FPS_OF_GIF = 50.0
"""Most pictures per second of a GIF: it counts hundredths of a second, and viewers slow down below two."""

LONGEST_S_OF_GIF = 655.35
"""Longest time for which a GIF shows a picture, in seconds: 16 bits count hundredths."""


def write_movie(path: Path, pictures: Sequence[Path], fps: float) -> None:
    """Write a film of PNG files as the suffix of `path` says."""
    with replacing(path) as new:
        WRITERS[path.suffix.lower()](new, pictures, fps)


def check(path: Path, fps: float) -> None:
    """Refuse a film that could not be written, before the work begins."""
    need("PIL.Image", "to write pictures")
    if path.suffix.lower() == ".mp4":
        need("imageio_ffmpeg", "to write MP4 files")
    elif fps > MOST_FPS_OF_GIF:
        raise InputError("--fps", fps, f"a GIF has {MOST_FPS_OF_GIF:g} at most", "use fewer, or .mp4")
    elif 0.0 < fps < 1.0 / LONGEST_S_OF_GIF:
        rule = f"a GIF shows each frame for {LONGEST_S_OF_GIF} s at most"
        raise InputError("--fps", fps, rule, "use more, or .mp4")


def _opened(pictures: Sequence[Path]) -> Iterator[Any]:
    """Yield the pictures one after another, as RGB."""
    pillow = need("PIL.Image", "to read PNG files")
    for path in pictures:
        try:
            with pillow.open(path) as picture:
                rgb = picture.convert("RGB")
        except OSError as error:
            reason = error.strerror or str(error)
            raise InputError("image", str(path), f"cannot be read: {reason}", "render it again") from None
        yield rgb


def _write_gif(path: Path, pictures: Sequence[Path], fps: float) -> None:
    """Write a GIF that repeats for ever; each picture has a palette of its own."""
    (first,) = _opened(pictures[:1])
    others = _opened(pictures[1:])
    try:
        first.save(path, format="GIF", save_all=True, append_images=others, duration=1000.0 / fps, loop=0)
    except OverflowError:
        # Pillow joins equal pictures to one that is shown for longer.
        rule = f"a GIF shows a frame, or equal frames in a row, for {LONGEST_S_OF_GIF} s at most"
        raise InputError("animation", str(path), rule, "make it shorter, or .mp4") from None


def _write_mp4(path: Path, pictures: Sequence[Path], fps: float) -> None:
    """Write H.264 with the ffmpeg that comes with its package."""
    ffmpeg = need("imageio_ffmpeg", "to write MP4 files")
    writer = None
    try:
        for picture in _opened(pictures):
            if writer is None:
                # The pictures have even sides, which is all that H.264 asks for.
                writer = ffmpeg.write_frames(
                    str(path), picture.size, fps=fps, codec="libx264", quality=8, macro_block_size=2
                )
                writer.send(None)
            writer.send(picture.tobytes())
    finally:
        if writer is not None:
            writer.close()


WRITERS: Mapping[str, Callable[[Path, Sequence[Path], float], None]] = {
    ".mp4": _write_mp4,
    ".gif": _write_gif,
}
"""How a film is written, by the suffix of its name."""
