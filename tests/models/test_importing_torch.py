"""What PyTorch exports now is imported as the committed files are, and computes what PyTorch does."""

import numpy as np
import pytest
import strangers
from packages import needed

from wamnet.models.importing.network import import_network
from wamnet.refimpl.network.imported import evaluate

pytestmark = [pytest.mark.apart, pytest.mark.needs("packages")]


@pytest.mark.parametrize("stranger", strangers.STRANGERS, ids=lambda each: each.name)
def test_an_export_of_today(stranger, tmp_path):
    needed("onnx")
    torch = needed("torch")
    path = tmp_path / stranger.path.name
    strangers.export(stranger.name, path)
    ours, before = (
        import_network(each, {"": (stranger.low, stranger.high)}, stranger.border).model
        for each in (path, stranger.path)
    )
    for a, b in zip(
        ours.siren.weights + ours.siren.biases, before.siren.weights + before.siren.biases, strict=True
    ):
        assert np.array_equal(a, b)
    assert (ours.siren.steps, ours.window) == (before.siren.steps, before.window)
    image = stranger.image()
    with torch.no_grad():
        module = strangers.modules()[stranger.name].double()
        theirs = module(torch.from_numpy(stranger.tensor(image.astype(np.float64)))).numpy()
    error = stranger.inside(evaluate(ours.siren, ours.window, {"x": image}) - stranger.picture(theirs))
    # Sums of fewer than 100 terms of magnitudes below 32 in float64, amplified by less than 32 * 10.
    assert np.abs(error).max() <= 100 * 2.0**-53 * 32 * 320
