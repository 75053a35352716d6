"""Records of experiments: nothing is lost, nothing is done twice, and two experiments are never mixed."""

import pytest
from lab import command
from lab.results import Results, fill
from lab.tables import Column, table

from wamnet.refimpl.errors import InputError, TrainingError


@pytest.fixture
def results(tmp_path):
    return Results.open(tmp_path / "found.json", "test", {"size": 8})


def test_an_interrupted_run_goes_on(results):
    done = []

    def work(seed):
        if (len(done)) == 2:
            raise KeyboardInterrupt
        done.append(seed)
        return {"psnr": 30.0 + seed}

    with pytest.raises(KeyboardInterrupt):
        fill(results, {"a": work, "b": work}, (0, 1, 2))
    assert done == [0, 1]
    later = Results.open(results.path, "test", {"size": 8})
    fill(later, {"a": lambda seed: {"psnr": 30.0 + seed}, "b": lambda seed: {"psnr": 20.0}}, (0, 1, 2))
    assert later.of("a", "psnr") == [30.0, 31.0, 32.0]
    assert len(later.records()) == 6
    fill(later, {"a": lambda seed: pytest.fail("it is there")}, (0, 1, 2))


def test_another_experiment_s_file_is_refused(results):
    with pytest.raises(InputError, match="belongs to test with settings"):
        Results.open(results.path, "test", {"size": 16})
    with pytest.raises(InputError, match="belongs to test"):
        Results.open(results.path, "other", {"size": 8})
    results.path.write_text("{")
    with pytest.raises(InputError, match="is not a file of results"):
        Results.open(results.path, "test", {"size": 8})


def test_numbers_of_each_pose_have_an_interval(results):
    for seed, poses in enumerate(([30.0, 34.0], [31.0, 35.0])):
        results.put("a", seed, {"psnr": sum(poses) / 2, "ms": 2.0, "per_frame": {"psnr": poses}})
    assert results.per_pose("a", "psnr") == [[30.0, 34.0], [31.0, 35.0]]
    assert results.per_pose("a", "ms") == [[2.0], [2.0]]
    found = results.interval("a", "psnr")
    assert (found.mean, found.low, found.high) == (32.5, 30.0, 35.0)
    assert results.interval("a", "ssim") is None
    columns = [Column("psnr", "PSNR, dB", 1, interval=True), Column("ms", "us", 0, 1000.0, interval=True)]
    assert table(results, columns).splitlines()[-1] == "| a | 32.5 [30.0, 35.0] | 2000 [2000, 2000] |"


def test_errors_end_with_one_line_and_a_status(capsys):
    def refused(arguments):
        raise TrainingError("the loss is not finite")

    with pytest.raises(SystemExit) as left:
        command.begin(refused, [])
    assert (left.value.code, capsys.readouterr().err) == (2, "wamnet: the loss is not finite\n")

    def interrupted(arguments):
        raise KeyboardInterrupt

    with pytest.raises(SystemExit) as left:
        command.begin(interrupted, [])
    assert left.value.code == 130
