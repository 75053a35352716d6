"""The paper's baselines in PyTorch: architectures, losses by hand, and training that can be resumed.

Without PyTorch they are skipped, and the summary says so; `.ci/run` installs and requires it.
"""

import json
import os
from dataclasses import replace

import numpy as np
import pytest
from baselines.recipe import Recipe
from lab import frames
from lab.frames import Shot
from packages import Late

from wamnet.refimpl import metrics
from wamnet.refimpl.encoding import to_display
from wamnet.refimpl.errors import InputError, TrainingError

pytestmark = [pytest.mark.apart, pytest.mark.needs("packages")]

torch = Late("torch", "torch")
dncnn, fitting, pix2pix = (Late(f"baselines.{name}", "torch") for name in ("dncnn", "fitting", "pix2pix"))

DNCNN = Recipe("dncnn", steps=4, batch=2, crop=8, learning_rate=1e-3, width=4)
PIX2PIX = Recipe(
    "pix2pix", 3, batch=1, crop=64, learning_rate=2e-4, width=2, features=("color", "normal"), tiles=True
)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("frames")
    shots = [Shot("cornell", size=64, seed=seed) for seed in range(2)]
    found = frames.render_all(folder, [make(s) for s in shots for make in (frames.noisy, _clean)], "numpy")
    return list(zip(found[::2], found[1::2], strict=True))


def _clean(shot):
    return frames.reference(shot, 2)


def make(recipe):
    return dncnn.DnCNN(recipe, depth=4) if recipe.method == "dncnn" else pix2pix.Pix2pix(recipe)


# ---- architectures ---------------------------------------------------------------------------------------


def test_dncnn_has_sixteen_convolutions_and_their_parameters():
    net = dncnn.network()
    convolutions = [layer for layer in net if isinstance(layer, torch.nn.Conv2d)]
    assert len(convolutions) == 16
    # First: 64 kernels of 3x3x3 and biases. Fourteen: 64 of 3x3x64, a scale and a shift. Last: 3 of 3x3x64.
    expected = 64 * 28 + 14 * (64 * 64 * 9 + 2 * 64) + 3 * (64 * 9 + 1)
    assert sum(p.numel() for p in net.parameters()) == expected
    assert net(torch.zeros(2, 3, 9, 7)).shape == (2, 3, 9, 7)


def test_pix2pix_has_six_levels_and_their_parameters():
    made = pix2pix.Pix2pix(replace(PIX2PIX, width=8))
    channels = [8, 16, 32, 64, 64, 64]
    assert pix2pix.widths(8) == channels
    # Kernels of 4x4. Down: six channels of features and one of noise, then the level before.
    down = sum(16 * a * b + b for a, b in zip([7, *channels[:-1]], channels, strict=True))
    # Up: the lowest level, then what comes up beside what is joined to it.
    up = sum(16 * a * b + b for a, b in zip([64, 128, 128, 64, 32, 16], [64, 64, 32, 16, 8, 3], strict=True))
    judge = (16 * 9 * 8 + 8) + (16 * 8 * 16 + 16) + (16 * 16 + 1)
    assert fitting.sizes(made) == {"generator": down + up, "discriminator": judge}
    patch = torch.zeros(1, 6, 128, 128)
    assert made.make(patch, fitting.generator_of(0, 0)).shape == (1, 3, 128, 128)
    # Two strides of 2 and a last layer that loses one: 128 -> 64 -> 32 -> 31.
    assert made.discriminator(torch.zeros(1, 9, 128, 128)).shape == (1, 1, 31, 31)


def test_the_generator_depends_on_its_noise():
    made, patch = make(PIX2PIX), torch.full((1, 6, 64, 64), 0.5)
    one, other = (made.make(patch, fitting.generator_of(0, step)) for step in (0, 1))
    assert not torch.equal(one, other)
    assert torch.equal(one, made.make(patch, fitting.generator_of(0, 0)))
    assert 0.0 <= float(one.detach().min()) <= float(one.detach().max()) <= 1.0


def test_patches_must_halve_evenly():
    with pytest.raises(InputError, match="side of pix2pix's patches 96: 6 levels halve it"):
        make(replace(PIX2PIX, crop=96))


# ---- losses, by hand -------------------------------------------------------------------------------------


def test_residual_loss_by_hand():
    noisy = torch.tensor([[[[0.5, 0.75]]], [[[0.25, 1.0]]]])
    clean = torch.tensor([[[[0.25, 0.75]]], [[[0.5, 0.5]]]])
    residual = torch.tensor([[[[0.5, 0.0]]], [[[0.25, 0.5]]]])
    # R - (y - x): 0.5 - 0.25, 0 - 0, 0.25 + 0.25, 0.5 - 0.5; squares 0.0625 + 0.25; over 2 N = 4.
    assert dncnn.residual_loss(residual, noisy, clean).item() == 0.3125 / 4


def test_adversarial_losses_by_hand():
    real, fake = torch.tensor([1.0, 0.5]), torch.tensor([0.0, 0.5])
    # L(real, 1) = (0 + 0.25)/2, L(fake, 0) = (0 + 0.25)/2, half their sum.
    assert pix2pix.discriminator_loss(real, fake).item() == 0.125
    made, clean = torch.tensor([0.5, 0.25]), torch.tensor([0.0, 0.5])
    # L(fake, 1) = (1 + 0.25)/2, L1 = (0.5 + 0.25)/2.
    assert pix2pix.generator_loss(fake, made, clean).item() == 0.625 + 100.0 * 0.375


def test_dncnn_takes_its_noise_away(files):
    made, frame = make(DNCNN), fitting.read_frame(files[0][0])
    for parameter in made.network[-1].parameters():
        torch.nn.init.zeros_(parameter)
    noisy = np.moveaxis(fitting.planes(frame, ("color",))[0].numpy(), 0, -1)
    assert np.array_equal(made.picture(frame), noisy)
    torch.nn.init.constant_(made.network[-1].bias, 0.25)
    assert np.array_equal(made.picture(frame), np.clip(noisy - np.float32(0.25), 0.0, 1.0))


# ---- pictures ---------------------------------------------------------------------------------------------


def test_pix2pix_denoises_patch_by_patch(files, monkeypatch):
    """With a generator that shows a patch's first pixel everywhere, a picture is made of flat patches."""
    made, frame = make(PIX2PIX), fitting.read_frame(files[0][0])
    monkeypatch.setattr(made, "make", lambda noisy, _: noisy[:, :3, :1, :1].expand(-1, -1, 32, 32))
    monkeypatch.setattr(made, "recipe", replace(PIX2PIX, crop=32))
    picture, noisy = made.picture(frame), np.moveaxis(fitting.planes(frame, ("color",))[0].numpy(), 0, -1)
    assert picture.shape == (64, 64, 3)
    for y in (0, 32):
        for x in (0, 32):
            assert np.all(picture[y : y + 32, x : x + 32] == noisy[y, x])


def test_a_side_that_is_no_multiple_is_continued(files, monkeypatch):
    made, frame = make(PIX2PIX), fitting.read_frame(files[0][0])
    monkeypatch.setattr(made, "make", lambda noisy, _: noisy[:, :3])
    monkeypatch.setattr(made, "recipe", replace(PIX2PIX, crop=40))
    noisy = np.moveaxis(fitting.planes(frame, ("color",))[0].numpy(), 0, -1)
    assert np.array_equal(made.picture(frame), noisy)


# ---- training --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("recipe", [DNCNN, replace(DNCNN, half=True), PIX2PIX], ids=["f32", "half", "gan"])
def test_an_interrupted_training_goes_on_to_the_same_weights(tmp_path, files, recipe):
    data = fitting.examples(recipe, files, tmp_path)
    whole = make(recipe)
    facts = fitting.fit(whole, recipe, data, data, tmp_path / "whole")
    first = fitting.fit(make(recipe), recipe, data, data, tmp_path / "parts", until=1)
    assert first["steps_done"] == 1
    spent = torch.load(next((tmp_path / "parts").glob("*.checkpoint")))["seconds"]
    later = make(replace(recipe, seed=9))  # other weights, which the checkpoint replaces
    again = fitting.fit(later, recipe, data, data, tmp_path / "parts")
    assert again["history"] == facts["history"]
    assert again["seconds"] > spent > 0.0
    for key, value in fitting._parts(whole).items():
        assert torch.equal(value, fitting._parts(later)[key]), key
    # It was not flat, so it may resume: two steps more are those of a training that had them from the start.
    longer = replace(recipe, steps=recipe.steps + 2)
    on = fitting.fit(later, longer, data, data, tmp_path / "parts")
    straight = fitting.fit(make(longer), longer, data, data, tmp_path / "straight")
    assert on["history"] == straight["history"]
    assert len(on["history"]) == len(facts["history"]) + 2


def test_finished_networks_are_read(tmp_path, files, monkeypatch):
    data = fitting.examples(DNCNN, files, tmp_path)
    trained, other = make(DNCNN), make(replace(DNCNN, seed=5))
    facts = fitting.fit(trained, DNCNN, data, data, tmp_path)
    recipe = json.loads(fitting.path_of(tmp_path, DNCNN, data, data).with_suffix(".json").read_text())[
        "recipe"
    ]
    assert Recipe(**{**recipe, "features": tuple(recipe["features"])}) == DNCNN
    monkeypatch.setattr(fitting, "_one", None)  # another step would fail
    assert fitting.fit(other, DNCNN, data, data, tmp_path) == json.loads(json.dumps(facts))
    for key, value in fitting._parts(trained).items():
        assert torch.equal(value, fitting._parts(other)[key]), key


def test_ctrl_c_waits_for_the_end_of_a_step(tmp_path, files, monkeypatch):
    import signal

    data, made = fitting.examples(DNCNN, files, tmp_path), make(DNCNN)
    real = fitting._one

    def interrupted(*arguments):
        os.kill(os.getpid(), signal.SIGINT)
        return real(*arguments)

    monkeypatch.setattr(fitting, "_one", interrupted)
    with pytest.raises(KeyboardInterrupt):
        fitting.fit(made, DNCNN, data, data, tmp_path / "parts")
    monkeypatch.setattr(fitting, "_one", real)
    facts = fitting.fit(make(DNCNN), DNCNN, data, data, tmp_path / "parts")
    assert facts["history"] == fitting.fit(make(DNCNN), DNCNN, data, data, tmp_path / "whole")["history"]


def test_training_learns(tmp_path, files):
    """The loss on one crop that repeats falls: gradients have the right sign."""
    recipe = replace(DNCNN, steps=24, batch=1, crop=32, learning_rate=1e-2, tiles=True)
    data = fitting.examples(recipe, files[:1], tmp_path)
    facts = fitting.fit(make(recipe), recipe, data, data, tmp_path)
    assert facts["history"][-1] < 0.5 * facts["history"][0]


def test_a_curve_is_flat_where_its_last_third_gains_nothing():
    rising = [0.1 * n for n in range(30)]
    assert not fitting.flat(rising)
    assert not fitting.flat([20.0] * (fitting.FEWEST_LOOKS - 1))
    assert fitting.flat([20.0] * fitting.FEWEST_LOOKS)
    # Twelve looks: eight before, four in the last third. A step of twice the gain is exact in binary.
    gain = 2.0**-5
    assert gain < fitting.FLAT_DB < 2 * gain
    assert fitting.flat([20.0] * 11 + [20.0 + gain])
    assert not fitting.flat([20.0] * 11 + [20.0 + 2 * gain])
    # A peak of the first part counts: what comes later does not gain on it.
    assert fitting.flat([20.0, 25.0, *rising[:16]])


def test_training_stops_where_both_rates_are_flat(tmp_path, files, monkeypatch):
    """A network that cannot improve takes the fewest looks at each rate, then at a tenth of it."""
    recipe = replace(DNCNN, steps=200, every=2)
    data, shares = fitting.examples(recipe, files, tmp_path), []
    real = fitting._one
    monkeypatch.setattr(fitting, "_one", lambda *given: shares.append(given[-1]) or real(*given))
    monkeypatch.setattr(fitting, "validated", lambda *_: 20.0)
    facts = fitting.fit(make(recipe), recipe, data, data, tmp_path)
    stage = 2 * fitting.FEWEST_LOOKS
    assert facts["flat"]
    assert not list(tmp_path.glob("*.checkpoint"))
    assert facts["steps_done"] == 2 * stage
    assert shares == [1.0] * stage + [0.1] * stage
    assert [look["step"] for look in facts["curve"]] == list(range(2, 2 * stage + 1, 2))


def test_the_network_of_the_best_look_is_kept(tmp_path, files, monkeypatch):
    recipe, found = replace(DNCNN, every=1), iter([20.0, 23.0, 22.0, 21.0])
    data, seen = fitting.examples(recipe, files, tmp_path), []

    def look(method, *_):
        seen.append({name: tensor.clone() for name, tensor in fitting._parts(method).items()})
        return next(found)

    monkeypatch.setattr(fitting, "validated", look)
    made = make(recipe)
    facts = fitting.fit(made, recipe, data, data, tmp_path)
    assert not facts["flat"]  # four steps are all it may do
    for key, value in fitting._parts(made).items():
        assert torch.equal(value, seen[1][key]), key
    assert any(not torch.equal(seen[1][key], seen[3][key]) for key in seen[1])


def test_an_interrupted_training_has_the_same_curve(tmp_path, files):
    recipe = replace(DNCNN, every=1)
    data = fitting.examples(recipe, files, tmp_path)
    whole = fitting.fit(make(recipe), recipe, data, data, tmp_path / "whole")
    fitting.fit(make(recipe), recipe, data, data, tmp_path / "parts", until=3)
    parts = fitting.fit(make(replace(recipe, seed=9)), recipe, data, data, tmp_path / "parts")
    assert [look["psnr"] for look in parts["curve"]] == [look["psnr"] for look in whole["curve"]]
    assert len(whole["curve"]) == recipe.steps


@pytest.mark.parametrize("recipe", [DNCNN, PIX2PIX], ids=["dncnn", "gan"])
def test_validation_is_the_error_of_the_pictures(tmp_path, files, recipe):
    """Of pictures that are no larger than its part, it is the mean PSNR of what `picture` gives."""
    data, made = fitting.examples(recipe, files, tmp_path), make(recipe)
    expected = [
        metrics.psnr(made.picture(fitting.read_frame(noisy)), to_display(fitting.read_frame(clean)["color"]))
        for noisy, clean in files
    ]
    # The same float32 operations on the same numbers.
    assert abs(fitting.validated(made, recipe, data) - np.mean(expected)) <= 1e-5


def test_pytorch_uses_every_core():
    before = torch.get_num_threads()
    try:
        torch.set_num_threads(1)
        assert fitting.use_all_cores() == torch.get_num_threads() == len(os.sched_getaffinity(0))
    finally:
        torch.set_num_threads(before)


def test_a_loss_that_is_not_finite_is_told(tmp_path, files):
    made, data = make(DNCNN), fitting.examples(DNCNN, files, tmp_path)
    torch.nn.init.constant_(made.network[0].bias, float("nan"))
    with pytest.raises(TrainingError, match="loss of dncnn at step 0 nan: must stay finite"):
        fitting.fit(made, DNCNN, data, data, tmp_path)


def test_a_damaged_checkpoint_is_told(tmp_path, files):
    data = fitting.examples(DNCNN, files, tmp_path)
    path = fitting.path_of(tmp_path, DNCNN, data, data).with_suffix(".checkpoint")
    path.write_bytes(b"nothing")
    with pytest.raises(InputError, match=r"checkpoint '.*': cannot be read: .* \(remove it"):
        fitting.fit(make(DNCNN), DNCNN, data, data, tmp_path)


# ---- examples --------------------------------------------------------------------------------------------


def test_noisy_and_clean_crops_are_of_one_place(tmp_path, files):
    data = fitting.examples(DNCNN, [(noisy, noisy) for noisy, _ in files], tmp_path)
    noisy, clean = fitting.draw(DNCNN, 3, data)
    assert noisy.shape == (2, 3, 8, 8)
    assert torch.equal(noisy, clean)
    assert not torch.equal(noisy, fitting.draw(DNCNN, 4, data)[0])


def test_the_digest_is_that_of_what_is_looked_at(tmp_path, files):
    """Copies of the files under other names are the same examples; other files are not."""
    copies = []
    for pair in files:
        names = [tmp_path / f"copy-of-{path.name}" for path in pair]
        for path, name in zip(pair, names, strict=True):
            name.write_bytes(path.read_bytes())
        copies.append(tuple(names))
    digests = [fitting.examples(DNCNN, found, tmp_path).digest for found in (files, copies, files[:1], files)]
    assert digests[0] == digests[1] == digests[3] != digests[2]


def test_tiles_are_those_of_a_grid(tmp_path, files):
    recipe = replace(DNCNN, tiles=True, crop=32, batch=8)
    data = fitting.examples(recipe, files, tmp_path)
    tiles = [data.noisy[f][:, y : y + 32, x : x + 32] for f in (0, 1) for y in (0, 32) for x in (0, 32)]
    for crop in fitting.draw(recipe, 0, data)[0].numpy():
        assert any(np.array_equal(crop, tile) for tile in tiles)


def test_shrinking_takes_means():
    image = torch.arange(16.0).reshape(1, 1, 4, 4)
    assert fitting.shrunk(image, 2).flatten().tolist() == [2.5, 4.5, 10.5, 12.5]
    assert torch.equal(fitting.shrunk(image, 1), image)


def test_crops_that_do_not_fit_are_refused(tmp_path, files):
    with pytest.raises(InputError, match="size of the training pictures '16x16': crops of 32 pixels"):
        fitting.examples(replace(DNCNN, shrink=4, crop=32), files, tmp_path)
