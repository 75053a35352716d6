"""What records say of the paper's claims: verdicts that follow from their intervals, and words."""

from __future__ import annotations

from lab import paper
from lab.records import Records


def verdict(answer):
    """Return the verdict that an answer's interval and bound have."""
    if "mean" not in answer or answer["reason"]:
        return answer["verdict"]
    beyond = answer["low"] > answer["bound"], answer["high"] < answer["bound"]
    if not any(beyond):
        return "not decided"
    return "holds" if beyond[0] == answer["above"] else "does not hold"


def test_verdicts_follow_from_intervals():
    """A claim holds if all of the answers that decide it do; else the worst of them is its verdict."""
    found = [r["values"] for r in Records()["claims"].records() if "verdict" in r["values"]]
    assert len(found) == 16
    for values in found:
        answers = values["answers"]
        assert [answer["verdict"] for answer in answers] == [verdict(answer) for answer in answers]
        deciding = {answer["verdict"] for answer in answers if answer["decides"]} or {"not tested"}
        order = ("does not hold", "not tested", "not decided", "holds")
        assert values["verdict"] == next(each for each in order if each in deciding), values["claim"]


def test_the_ssim_excludes_dark_frames_where_the_psnr_does_not():
    psnr = [[14.0, 19.0, 24.0, 31.0], [14.5, 19.5, 24.5, 31.5]]
    text = paper.follows(psnr, [[0.1, 0.2, 0.35, 0.7], [0.1, 0.2, 0.36, 0.71]])
    start = "An MSE of 82.93 is 28.94 dB. Noisy frames so dark that they have this PSNR have an SSIM of 0.59"
    assert text.startswith(start)
    assert "where the paper prints 0.21: so it is not the MSE of frames like these" in text
    assert "does not exclude the 0.21" in paper.follows(psnr, [[0.1, 0.1, 0.1, 0.25], [0.1, 0.1, 0.2, 0.25]])
    assert "which not all of the noisy frames have" in paper.follows([[14.0, 19.0]], [[0.1, 0.2]])
