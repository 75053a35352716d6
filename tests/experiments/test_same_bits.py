"""The table of same bits: ways that agree, one that does not, and one that is not here."""

from __future__ import annotations

import json
import socket
import threading
from dataclasses import replace

import numpy as np
import pytest
import same_bits
from lab import browsers, same
from same_bits import FULL, WHOLE, Way

from wamnet.models.model_file import save_model
from wamnet.refimpl.errors import ExecutorUnavailable
from wamnet.refimpl.network.dataset import Normalization, Window, n_inputs
from wamnet.refimpl.network.denoise import Model

FEATURES = ("color", "normal")


@pytest.fixture
def case(kit, tmp_path):
    """The folder of a small network's case, and the digest of its picture."""
    window = Window(3, "clamp")
    network = kit.network([n_inputs(FEATURES, window), 6, 3], (3.0, 3.0))
    model = Model(network, FEATURES, window, Normalization(), {"trained_on_scene": "lone_light"})
    save_model(tmp_path / "model.safetensors", model)
    return tmp_path, same_bits.made(tmp_path, tmp_path / "model.safetensors", "whole8", 6)


def numpy_way():
    return next(way for way in same_bits.WAYS if way.kind == "numpy")


def test_ways_that_agree(case):
    folder, digest = case
    found = same_bits.answer(numpy_way(), "plain", folder)
    assert found[WHOLE]["digest"] == digest
    assert (found[WHOLE]["differ"], found[FULL]["differ"]) == (0, 0)


def test_a_way_that_differs_is_named(case, monkeypatch, capsys):
    folder, digest = case

    def wrong(model, images, schedule):
        device, picture = numpy_way().run(model, images, schedule)
        picture = picture.copy()
        picture[2, 4, 1] += np.float32(2.0**-16)
        return device, picture

    way = Way("numpy", "wrong", wrong)
    found = same_bits.answer(way, "plain", folder)
    assert found[WHOLE]["first"].startswith("pixel (4, 2), channel 1: ")
    assert found[WHOLE]["differ"] == 1 / 108
    monkeypatch.setattr(same_bits, "WAYS", (way,))
    monkeypatch.setattr(same_bits, "asked", lambda number, schedule, folder: found)
    with pytest.raises(SystemExit, match="1"):
        same_bits.main(["--model", str(folder / "model.safetensors"), "--size", "6"])
    assert f"| {digest} | yes |" not in capsys.readouterr().out


def test_what_is_not_here_is_said(case, monkeypatch, capsys):
    folder, _ = case

    def missing(model, images, schedule):
        raise ExecutorUnavailable("no abacus")

    found = same_bits.answer(Way("numpy", "abacus", missing), "plain", folder)
    assert found == {"missing": "no abacus"}
    monkeypatch.setattr(same_bits, "asked", lambda number, schedule, folder: found)
    same_bits.main(["--model", str(folder / "model.safetensors"), "--size", "6", "--only", "numpy"])
    assert "| NOT HERE: no abacus |" in capsys.readouterr().out


@pytest.mark.parametrize(
    "lacks", [{"needs": "/no/such/driver"}, {"needs": "nosuchlibrary"}, {"environment": {"CC": "nosuchcc"}}]
)
def test_what_a_way_lacks_is_said_once(monkeypatch, lacks, tmp_path):
    """One row for all schedules, and no process."""
    way = replace(numpy_way(), schedules=("plain", "tile:16"), way_out="build it", **lacks)
    monkeypatch.setattr(same_bits, "WAYS", (way,))
    monkeypatch.setattr(same_bits, "asked", lambda *asked: pytest.fail("it is not here"))
    (cells,) = same_bits.rows([], tmp_path, "")
    assert cells[1].startswith("NOT HERE: there is no ")
    assert cells[3] == "plain, tile:16"


def test_a_way_that_lacks_nothing():
    assert same_bits.lacking(numpy_way()) == ""
    assert same_bits.lacking(replace(numpy_way(), needs=str(same_bits.__file__))) == ""
    assert same_bits.lacking(replace(numpy_way(), needs="c")) == ""


def test_rows_of_a_document():
    """Schedules of one way are one row; one that is not here is shown, and one that differs is not equal."""

    def row(name, schedule, digest, equal, share):
        cells = (name, "device", "-", schedule, digest, equal, share)
        return {"values": dict(zip(same_bits.HEADS, cells, strict=True))}

    class Results:
        def records(self):
            return [
                row("a", "plain", "12", "yes", "9.5%"),
                row("a", "tile:16", "12", "NO: pixel (0, 0)", "75.0%"),
                row("a", "group", "12", "yes", "refused"),
                row("b", "plain, group", "-", "-", "-"),
            ]

    lines = same.summary({same.RECORD: Results()}).splitlines()
    assert lines[2:] == [
        "| a | device | - | plain, tile:16, group | 2 of 3 | 9.5% to refused |",
        "| b | device | - | plain, group | - | - |",
    ]


def served(answers):
    """Return the port of a server that greets, and answers each message by the next of some."""
    server = socket.create_server(("127.0.0.1", 0))

    def answer():
        connection, _ = server.accept()
        with connection, server:
            connection.sendall(b'50:{"applicationType":"gecko","marionetteProtocol":3}')
            for error, found in answers:
                connection.recv(65536)
                text = json.dumps([1, 1, error, found]).encode()
                connection.sendall(b"%d:" % len(text) + text[:3])
                connection.sendall(text[3:])

    threading.Thread(target=answer, daemon=True).start()
    return server.getsockname()[1]


def test_messages_of_firefox():
    """An answer may come in parts; one that is an error, and an end, raise."""
    tab = browsers.Marionette(served([(None, {"value": "x" * 5000}), ({"message": "no such window"}, None)]))
    assert tab.ask("WebDriver:ExecuteScript", script="", args=[])["value"] == "x" * 5000
    with pytest.raises(ExecutorUnavailable, match="Firefox: WebDriver:Navigate: no such window"):
        tab.ask("WebDriver:Navigate", url="about:blank")
    with pytest.raises(ExecutorUnavailable, match="Firefox has ended"):
        tab.ask("WebDriver:Navigate", url="about:blank")
    tab.close()


def test_what_takes_minutes_is_asked_for(monkeypatch, tmp_path):
    """By --slow; without it a row says what was not run."""
    way = replace(numpy_way(), slow=("group",))
    monkeypatch.setattr(same_bits, "WAYS", (way,))
    monkeypatch.setattr(same_bits, "asked", lambda number, schedule, folder: {"missing": schedule})
    first, second = same_bits.rows([], tmp_path, "")
    assert (first[1], second[1]) == ("NOT HERE: plain", "NOT RUN: takes minutes, add --slow")
    assert [cells[1] for cells in same_bits.rows([], tmp_path, "", slow=True)] == [
        "NOT HERE: plain",
        "NOT HERE: group",
    ]
