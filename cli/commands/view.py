"""`wamnet view`: a model at work in the browser, on a scene that is path-traced there.

1. Make the page [`webpage.page_of`]; with -o it is written to a file, and that is all.
2. Serve it on the loopback interface, only to this machine, and open the browser [`serve`]; Ctrl-C ends.
3. A request must name this machine and the port (header Host): a page of another site whose name was made to
   point here could read the model otherwise (DNS rebinding). Connections have a time limit, and are few at
   once [`PageServer`].
"""

import socket
import threading
import webbrowser
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from ...refimpl.errors import InputError
from ..common.terminal import say
from ..files.outputs import check_output, write_text
from ..reports.webpage import page_of

HOST = "127.0.0.1"
"""Where the page is served: only to this machine."""

MOST_CONNECTIONS = 16
"""Connections that are answered at once: a browser opens six."""

LONGEST_CONNECTION_S = 10.0
"""Seconds after which a connection is closed, whatever it waits for: some megabytes go to the same machine in
far less."""


def view(
    model: Path,
    scene: str | None = None,
    fast: Path | None = None,
    parameters: list[str] | None = None,
    port: int = 0,
    browser: bool = True,
    output: Path | None = None,
) -> None:
    """Show a model in the browser: the scene, path-traced live, its normals, and the denoised image."""
    if output is not None:
        check_output(output, (".html", ".htm"), [path for path in (model, fast) if path])
    page = page_of(model, scene, parameters or [], fast)
    if output is not None:
        write_text(output, page)
        say(str(output))
        return
    serve(page.encode(), port, browser)


def serve(page: bytes, port: int, browser: bool) -> None:
    """Serve one page until Ctrl-C."""
    try:
        server = PageServer((HOST, port), handler_of(page))
    except OSError as error:
        reason = error.strerror or "in use"
        raise InputError("--port", port, f"cannot be opened: {reason}", "choose another, or 0") from None
    with server:
        address = f"http://{HOST}:{server.server_address[1]}/"
        say(f"{address} (Ctrl-C to stop)")
        if browser:
            webbrowser.open(address)
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            say("stopped")


class PageServer(ThreadingHTTPServer):
    """A server of few connections, each of which ends: who connects and says nothing keeps nobody out."""

    daemon_threads = True

    def __init__(
        self,
        address: tuple[str, int],
        handler: type[BaseHTTPRequestHandler],
        most: int = MOST_CONNECTIONS,
        seconds: float = LONGEST_CONNECTION_S,
    ) -> None:
        self.places, self.seconds = threading.BoundedSemaphore(most), seconds
        super().__init__(address, handler)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answer a connection in a thread of its own, or close it where all places are taken."""
        if not self.places.acquire(blocking=False):
            self.shutdown_request(request)
            return
        try:
            super().process_request(request, client_address)
        except BaseException:
            self.places.release()
            raise

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Answer a connection; a clock ends it, since a byte now and then would outlast a socket's limit."""
        clock = threading.Timer(self.seconds, _end, (request,))
        clock.daemon = True
        clock.start()
        try:
            super().process_request_thread(request, client_address)
        finally:
            clock.cancel()
            self.places.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing: a connection that ends early is no concern of who looks at the page."""


def _end(connection: socket.socket) -> None:
    """End a connection, whichever side waits."""
    with suppress(OSError):
        connection.shutdown(socket.SHUT_RDWR)


def handler_of(page: bytes) -> type[BaseHTTPRequestHandler]:
    """Return a handler that knows one page."""

    class Handler(BaseHTTPRequestHandler):
        """Answers `/` where the request names this machine, and nothing else."""

        def do_GET(self) -> None:
            if self._answered():
                self.wfile.write(page)

        def do_HEAD(self) -> None:
            self._answered()

        def _answered(self) -> bool:
            """Send the head of an answer; tell whether the page comes after it."""
            port = self.server.server_address[1]  # type: ignore[index]
            hosts = self.headers.get_all("Host") or []
            # What a browser on this machine calls it.
            names = [f"{name}:{port}" for name in (HOST, "localhost", "[::1]")]
            if len(hosts) != 1 or hosts[0].strip(" \t").lower() not in names:
                self.send_error(HTTPStatus.MISDIRECTED_REQUEST)
                return False
            if self.path != "/":
                self.send_error(HTTPStatus.NOT_FOUND)
                return False
            self.send_response(HTTPStatus.OK)
            self.send_header("Content-Type", "text/html; charset=utf-8")
            self.send_header("Content-Length", str(len(page)))
            self.send_header("Cache-Control", "no-store")
            self.send_header("X-Content-Type-Options", "nosniff")
            self.end_headers()
            return True

        def log_message(self, format: str, *args: object) -> None:  # noqa: A002 (the base class's name)
            """Say nothing: the address is all that people need."""

    return Handler
