"""Serves the page on this machine alone, and runs what it asks for with ngspice."""

import json
import warnings
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Lock
from typing import Any

from cosim.errors import CosimError
from cosim.files.link import LONGEST, is_link
from cosim.live.page import answer, html

HOST = "127.0.0.1"


class _Handler(BaseHTTPRequestHandler):
    """``/`` is the page; ``POST /run`` takes a link of it. Nothing else is there."""

    server: "Server"  # pyright: ignore[reportIncompatibleVariableOverride]
    timeout = 30
    sys_version = server_version = ""

    def do_GET(self) -> None:
        if not self._from_here():
            return
        if self.path != "/":
            self._send(404, b"There is only the page itself.", "text/plain")
            return
        self._send(200, self.server.page, "text/html; charset=utf-8")

    def do_POST(self) -> None:
        """Only the page itself may ask: another site's has another origin."""
        length = self.headers.get("Content-Length", "")
        if not self._from_here(needs_origin=True):
            return
        if self.path != "/run" or not length.isdecimal() or int(length) > LONGEST:
            self._tell(404, {"error": "There is only run, which takes a link."})
            return
        link = self.rfile.read(int(length)).decode("utf-8", "replace")
        if not is_link(link):
            self._tell(400, {"error": "This is not a link."})
        elif not self.server.busy.acquire(blocking=False):
            self._tell(503, {"error": "Another run is under way."})
        else:
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    self._tell(200, answer(link))
            except CosimError as error:
                self._tell(400, {"error": str(error)})
            finally:
                self.server.busy.release()

    def _from_here(self, needs_origin: bool = False) -> bool:
        """A name that leads here from elsewhere is refused, as is a page from elsewhere."""
        origin = self.headers.get("Origin", None if needs_origin else self.server.address)
        if f"http://{self.headers.get('Host')}" == self.server.address == origin:
            return True
        self._send(403, b"This page is for this machine.", "text/plain")
        return False

    def _tell(self, code: int, content: Any) -> None:
        self._send(code, json.dumps(content).encode(), "application/json")

    def _send(self, code: int, body: bytes, kind: str) -> None:
        self.send_response(code)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:
        """Nothing is written down."""


class Server(ThreadingHTTPServer):
    """The page at ``address``, on a free port."""

    daemon_threads = True

    def __init__(self, fragment: str) -> None:
        super().__init__((HOST, 0), _Handler)
        self.address = f"http://{HOST}:{self.server_port}"
        self.page = html(fragment, served=True).encode()
        self.busy = Lock()


def serve(fragment: str, begun: Callable[[str], object]) -> None:
    """Serve until interrupted; ``begun`` is told the address."""
    with Server(fragment) as server:
        begun(f"{server.address}/{fragment}")
        server.serve_forever(poll_interval=0.2)
