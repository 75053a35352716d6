"""The support matrix has every target; its cells are those of the records by test_records.py."""

from lab import support
from lab.records import Records

from wamnet.kernels.export.targets import NAMES


def test_every_target_has_a_row():
    lines = support.matrix(Records()).splitlines()[2:]
    assert sorted(line.split("`")[1] for line in lines) == sorted(NAMES)
