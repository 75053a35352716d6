"""Tests of films: a failure in the middle leaves no file, nor half of one."""

import numpy as np
import pytest

from wamnet.cli.files.images import write_panels
from wamnet.cli.files.movie import WRITERS, write_movie
from wamnet.refimpl.errors import InputError


def test_a_gif_that_stands_still_for_too_long(tmp_path) -> None:
    """Two pictures of 400 s are one of 800 s, which 16 bits of hundredths cannot say."""
    write_panels(tmp_path / "0.png", [("grey", np.full((16, 16, 3), 0.5))], "x")
    with pytest.raises(
        InputError, match=r"a GIF shows a frame, or equal frames in a row, for 655\.35 s at most.*or \.mp4"
    ):
        write_movie(tmp_path / "a.gif", 2 * [tmp_path / "0.png"], 1 / 400)
    assert [path.name for path in tmp_path.iterdir()] == ["0.png"]


@pytest.mark.parametrize("suffix", WRITERS)
def test_all_or_nothing(tmp_path, suffix) -> None:
    """The second picture is missing."""
    write_panels(tmp_path / "0.png", [("grey", np.full((16, 16, 3), 0.5))], "x")
    with pytest.raises(InputError, match=r"1\.png.*cannot be read"):
        write_movie(tmp_path / f"a{suffix}", [tmp_path / "0.png", tmp_path / "1.png"], 5.0)
    assert [path.name for path in tmp_path.iterdir()] == ["0.png"]
