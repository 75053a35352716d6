"""`experiments/course.py --students`: a class of right and wrong answers, graded by the command."""

from __future__ import annotations

import course
from wamnet_course.labs import lab_named


def test_a_class_is_graded_and_every_wrong_answer_found(tmp_path) -> None:
    """Of four students the first and the last are right, as every third one is."""
    lab = lab_named("1")
    assert course.class_of(4, [lab], tmp_path) == 2
    texts = [(tmp_path / f"student{k:02d}" / lab.file).read_text() for k in range(4)]
    assert texts[0] == texts[3]
    assert len(set(texts)) == 3
    heads, _, row = course.graded(4, [lab]).splitlines()
    found = dict(zip(heads.strip("| ").split(" | "), row.strip("| ").split(" | "), strict=True))
    assert {**found, "seconds": ""} == {
        "students": "4",
        "labs": "1",
        "right answers": "2",
        "wrong answers": "2",
        "complete": "2",
        "seconds": "",
    }
