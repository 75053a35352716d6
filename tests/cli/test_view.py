"""`wamnet view`: a page that is written or served, and what is refused before anything is computed."""

import contextlib
import json
import re
import shutil
import socket
import threading
import urllib.error
import urllib.request
from dataclasses import replace

import pytest

from wamnet.cli.commands import view
from wamnet.cli.reports import webpage
from wamnet.kernels.run.page import compiler
from wamnet.models.model_file import load_model, save_model
from wamnet.refimpl.light import scenes


@pytest.fixture
def here(samples, tmp_path):
    """Put model.safetensors into the working folder."""
    shutil.copy(samples / "model.safetensors", tmp_path / "model.safetensors")
    return tmp_path


def data_of(text):
    """Return the data that a page holds."""
    (found,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)
    return json.loads(found)


def test_a_page_is_written(wamnet, here):
    outcome = wamnet("view", "model.safetensors", "--scene", "lone_light", "-o", "page.html")
    assert outcome.status == 0, outcome.err
    assert outcome.out == "page.html\n"
    text = (here / "page.html").read_text(encoding="utf-8")
    data = data_of(text)
    assert (data["scene"], data["times"]) == ("lone_light", [0.5 / webpage.FPS])
    names = ["full", "fast", "fast-texture", "whole", *["processor"] * bool(compiler())]
    assert [one["name"] for one in data["variants"]] == names
    assert not re.search(r"(src|href)=\"(?!data:)", text), "nothing is fetched"
    assert "\n}\n" in data["paths"][0]["source"]
    assert "\n " not in data["paths"][0]["source"], "indentation is left out"
    assert wamnet("view", "model.safetensors", "--scene", "lone_light", "-o", "again.html").status == 0
    assert (here / "again.html").read_text(encoding="utf-8") == text, "a page is a function of its inputs"


def test_the_model_s_own_scene_is_shown_at_all_its_times(wamnet, here):
    """The model of the samples was trained on none: the page shows the mini cubes."""
    assert wamnet("view", "model.safetensors", "--fast", "model.safetensors", "-o", "page.html").status == 0
    data = data_of((here / "page.html").read_text(encoding="utf-8"))
    assert data["scene"] == "minicubes"
    assert len(data["times"]) == webpage.FRAMES


@pytest.mark.parametrize("name", ["minicubes", "glossy", "daylight"])
def test_scenes_move_without_changing_their_form(name):
    """All moments of each animation are one kernel."""
    from wamnet.kernels.run.page import moving_numbers
    from wamnet.refimpl.light.transport import Settings

    animation = webpage.animation_of(name)
    inputs, numbers = moving_numbers(animation, Settings())
    assert 0 < len(numbers["moving"]) < len(inputs.places)


def test_a_scene_file_is_still(wamnet, here):
    assert wamnet("scene", "glossy", "--time", "1", "-o", "mine.json").status == 0
    animation = webpage.animation_of(str(here / "mine.json"))
    assert animation.times == (0.0,)
    assert animation.scenes[0].name == "glossy"


def test_parameters_of_a_scene_hold_at_all_times():
    found = webpage.animation_of("minicubes", ["warm=1,0,0"])
    assert {scene.lights[0].color for scene in found.scenes} == {(1.0, 0.0, 0.0)}
    assert found.scenes[0].lights[1].color == scenes.COOL


def test_the_page_is_served_to_this_machine(wamnet, here, monkeypatch):
    """The browser that is opened gets the page, another address nothing; Ctrl-C stops it well."""
    found = {}

    def browse(address):
        def fetch():
            found["page"] = urllib.request.urlopen(address).read().decode()
            with pytest.raises(urllib.error.HTTPError, match="404"):
                urllib.request.urlopen(f"{address}other")

        found["address"], found["thread"] = address, threading.Thread(target=fetch)
        found["thread"].start()

    def serve_two(server):
        server.handle_request()
        server.handle_request()
        raise KeyboardInterrupt

    monkeypatch.setattr(view.webbrowser, "open", browse)
    monkeypatch.setattr(view.PageServer, "serve_forever", serve_two)
    monkeypatch.setattr(view, "page_of", lambda *_: "<!DOCTYPE html>")
    outcome = wamnet("view", "model.safetensors")
    found["thread"].join()
    assert outcome.status == 0
    assert outcome.out == f"{found['address']} (Ctrl-C to stop)\nstopped\n"
    assert found["address"].startswith("http://127.0.0.1:")
    assert found["page"] == "<!DOCTYPE html>"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--port", "70000"], "--port 70000: must be from 0 to 65535"),
        (["-o", "page.txt"], "must end in .html or .htm"),
        (["-o", "missing/page.html"], "not found"),
        (["--scene", "nowhere", "-o", "page.html"], "unknown"),
        (["--set", "time=2", "-o", "page.html"], "a page shows all times of a canonical scene"),
        (["--fast", "nothing.safetensors", "-o", "page.html"], "nothing.safetensors"),
    ],
)
def test_refusals(refused, here, arguments, said):
    assert said in refused("view", "model.safetensors", *arguments)


def test_a_port_that_is_taken_is_refused(refused, here, monkeypatch):
    monkeypatch.setattr(view, "page_of", lambda *_: "")
    with socket.socket() as taken:
        taken.bind((view.HOST, 0))
        taken.listen()
        line = refused("view", "model.safetensors", "--port", taken.getsockname()[1])
    assert "cannot be opened: Address already in use (choose another, or 0" in line


@pytest.mark.parametrize("learned", ["minicubes, cornell", "mine"])
def test_a_model_of_no_single_canonical_scene_needs_a_name(refused, here, learned):
    model = load_model(here / "model.safetensors")
    several = replace(model, info={"trained_on_scene": learned})
    save_model(here / "several.safetensors", several)
    line = refused("view", "several.safetensors", "-o", "page.html")
    assert f"scene that the model was trained on '{learned}': " in line
    assert "name one with --scene" in line


# ---- the server, through real sockets ---------------------------------------------------------------------

PAGE = b"<!DOCTYPE html>the page"


@pytest.fixture
def served():
    """Give a function that serves PAGE with limits, and returns the port."""
    servers = []

    def serve(most=view.MOST_CONNECTIONS, seconds=view.LONGEST_CONNECTION_S):
        server = view.PageServer((view.HOST, 0), view.handler_of(PAGE), most, seconds)
        servers.append(server)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        return server.server_address[1]

    yield serve
    for server in servers:
        server.shutdown()
        server.server_close()


def answer_to(port, text):
    """Send a request as it is, and return all that comes back: nothing where the connection is refused."""
    with socket.create_connection((view.HOST, port), timeout=60) as connection:
        try:
            connection.sendall(text.encode("latin-1"))
            return b"".join(iter(lambda: connection.recv(65536), b""))
        except ConnectionError:
            return b""


@pytest.mark.parametrize("name", ["127.0.0.1", "localhost", "LocalHost", "[::1]"])
def test_who_names_this_machine_gets_the_page(served, name):
    port = served()
    head, _, body = answer_to(port, f"GET / HTTP/1.1\r\nHost: {name}:{port}\r\n\r\n").partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.0 200 ")
    assert b"Cache-Control: no-store" in head
    assert b"X-Content-Type-Options: nosniff" in head
    assert body == PAGE


@pytest.mark.product
@pytest.mark.parametrize(
    "host",
    [
        "Host: evil.example:{port}\r\n", "Host: evil.example\r\n", "Host: 127.0.0.1\r\n",
            "Host: 127.0.0.1:1\r\n", "Host: 127.0.0.1:{port}.evil.example\r\n",
            "Host: 127.0.0.1:{port}\r\nHost: evil.example\r\n", "Host:\r\n", "",
    ],
)  # fmt: skip
@pytest.mark.parametrize("method", ["GET", "HEAD"])
def test_who_names_another_machine_gets_nothing(served, method, host):
    """A page of another site, whose name was made to point here, could read the model otherwise."""
    port = served()
    found = answer_to(port, f"{method} / HTTP/1.1\r\n{host.format(port=port)}\r\n")
    assert found.startswith(b"HTTP/1.0 421 ")
    assert PAGE not in found


def test_connections_are_few_and_make_room(served):
    """One too many is closed at once; those that say nothing, or a letter now and then, are ended too."""
    port = served(most=3, seconds=1.0)
    with contextlib.ExitStack() as made:
        idle = [made.enter_context(socket.create_connection((view.HOST, port), timeout=60)) for _ in range(3)]
        idle[0].sendall(b"GET / HT")
        fourth = made.enter_context(socket.create_connection((view.HOST, port), timeout=60))
        assert fourth.recv(1) == b"", "there is no place for it"
        for connection in idle:
            assert connection.recv(1) == b"", "the server has ended it"
    # The places are given back just after the connections are closed.
    while not (found := answer_to(port, f"GET / HTTP/1.1\r\nHost: localhost:{port}\r\n\r\n")):
        pass
    assert found.endswith(PAGE)
