"""Serves the page on this machine alone, and runs what it asks for with ngspice."""

import json
import sys
import time
import warnings
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Lock, Thread
from typing import Any

from cosim.errors import BadInput, CosimError
from cosim.files.link import LONGEST, is_link
from cosim.live.page import CIRCUITS, answer, html
from cosim.trials.recording import Recording

HOST = "127.0.0.1"

MOST, MOST_AWAITED = 60.0, 5.0
"""s of wall time that a run may take: in general, and once another request waits."""


class _Handler(BaseHTTPRequestHandler):
    """``GET /`` is the page; ``POST /run/CIRCUIT`` runs a link; all else is refused."""

    server: "Server"  # pyright: ignore[reportIncompatibleVariableOverride]
    timeout = 30
    sys_version = server_version = ""

    def do_GET(self) -> None:
        if self._from_here() and self.path == "/":
            self._send(200, self.server.page, "text/html; charset=utf-8")
        else:
            self._tell(404, {"error": "There is only the page itself, for this machine."})

    def do_POST(self) -> None:
        """Run a link for the page itself; pages of other sites have another origin."""
        length = self.headers.get("Content-Length", "")
        circuit = self.server.circuits.get(self.path.removeprefix("/run/"))
        sound = length.isdecimal() and len(length) < 10 and int(length) <= LONGEST
        if circuit is None or not (sound and self._from_here(needs_origin=True)):
            self._tell(404, {"error": "There is only run, which takes a link of the page."})
            return
        link = self.rfile.read(int(length)).decode("utf-8", "replace")
        try:
            if not is_link(link):
                raise BadInput("This is not a link.")
            self._tell(200, self.server.run(link, circuit))
        except CosimError as error:
            self._tell(400, {"error": str(error)})

    def _from_here(self, needs_origin: bool = False) -> bool:
        """Whether Host and Origin are this server's address; a host name from elsewhere is not."""
        origin = self.headers.get("Origin", None if needs_origin else self.server.address)
        return f"http://{self.headers.get('Host')}" == self.server.address == origin

    def _tell(self, code: int, content: Any) -> None:
        self._send(code, json.dumps(content).encode(), "application/json")

    def _send(self, code: int, body: bytes, kind: str) -> None:
        self.send_response(code)
        own = {"Content-Type": kind, "Content-Length": len(body), "Cache-Control": "no-store"}
        for name, value in own.items():
            self.send_header(name, str(value))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:
        """Log nothing."""


class Server(ThreadingHTTPServer):
    """The page at ``address``, on a free port."""

    daemon_threads = True

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore connections that a closed page has broken."""
        if not isinstance(sys.exception(), ConnectionError):
            super().handle_error(request, client_address)

    def __init__(
        self, link: str, circuits: dict[str, dict[str, Any]], record: Recording | None = None
    ) -> None:
        self.page = html(link, circuits, record).encode()
        self.circuits = circuits
        super().__init__((HOST, 0), _Handler)
        self.address = f"http://{HOST}:{self.server_port}"
        self.one_run = Lock()
        self.asked = 0
        Thread(target=self._warm, args=(link,), daemon=True).start()

    def run(self, link: str, circuit: dict[str, Any]) -> dict[str, Any]:
        """Run a link, one at a time. Raises CosimError, also where the run takes too long."""
        self.asked = own = self.asked + 1
        with self.one_run, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            began = time.monotonic()

            def heed(reached: float) -> None:
                most = MOST if self.asked == own else MOST_AWAITED
                if time.monotonic() - began > most:
                    raise BadInput(
                        f"The run was given up at t = {reached:.3g} s: the page gives it {MOST:g} "
                        f"s, and {MOST_AWAITED:g} s once another one waits; cosim run has no limit."
                    )

            return answer(link, circuit, heed)

    def _warm(self, link: str) -> None:
        """Make a first run, so that modules and workers are loaded before the page asks."""
        with suppress(CosimError):
            self.run(link, CIRCUITS["amplifier"])
