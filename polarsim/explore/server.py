"""The page on this machine: an HTTP server on 127.0.0.1 that knows a list of addresses and nothing else."""

from __future__ import annotations

import gzip
import logging
import sys
import threading
from collections import OrderedDict
from collections.abc import Mapping
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from polarsim.errors import ConfigError, PolarsimError
from polarsim.explore.site import Files

log = logging.getLogger("polarsim")

HOST = "127.0.0.1"  # never another one: nobody but this machine's users is asked in
MOST_KEPT = 256 << 20  # bytes of files that were asked for and may be asked for again
TYPES: Mapping[str, str] = {
    "html": "text/html; charset=utf-8",
    "css": "text/css; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
    "json": "application/json",
    "arrow": "application/vnd.apache.arrow.file",
    "jpg": "image/jpeg",
    "svg": "image/svg+xml",
    "txt": "text/plain; charset=utf-8",
}
HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' blob: data:; style-src 'self' 'unsafe-inline'; "
    "object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
}


class Kept:
    """What files hold, made once and kept while there is room."""

    def __init__(self, files: Files, most: int = MOST_KEPT) -> None:
        self._files, self._most, self._size = files, most, 0
        self._kept: OrderedDict[str, bytes] = OrderedDict()
        self._lock = threading.Lock()

    def read(self, name: str) -> bytes | None:
        """The content of an address; None where there is no such one."""
        if name not in self._files:
            return None
        with self._lock:
            if name in self._kept:
                self._kept.move_to_end(name)
                return self._kept[name]
        content = self._files[name]()
        with self._lock:
            self._size += len(content) - len(self._kept.get(name, b""))
            self._kept[name] = content
            while self._size > self._most and len(self._kept) > 1:
                self._size -= len(self._kept.popitem(last=False)[1])
        return content


def server(files: Files, port: int = 0) -> ThreadingHTTPServer:
    """A server that is bound and not yet running; port 0 takes a free one.

    Raises
    ------
    ConfigError
        The port is taken.
    """
    kept = Kept(files)

    class Handler(_Handler):
        content = kept

    try:
        return _Server((HOST, port), Handler)
    except OSError as error:
        raise ConfigError(f"port {port} of {HOST} cannot be used, {error.strerror}: name another by --port") from error


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A browser that left while it was answered is no error."""
        if not isinstance(sys.exc_info()[1], ConnectionError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    """Answers GET and HEAD for addresses that are in the list, letter by letter; nothing is decoded or joined."""

    content: Kept
    protocol_version = "HTTP/1.1"
    wbufsize = 1 << 16  # head and content leave together: apart, the second waits 40 ms for the first one's receipt
    server_version, sys_version = "polarsim", ""

    def do_GET(self) -> None:  # as http.server calls it
        self._answer(with_content=True)

    def do_HEAD(self) -> None:
        self._answer(with_content=False)

    def _answer(self, *, with_content: bool) -> None:
        if not self._asked_by_name():
            return self._refuse(HTTPStatus.MISDIRECTED_REQUEST)
        name = self.path.partition("?")[0].removeprefix("/") or "index.html"
        try:
            content = self.content.read(name)
        except PolarsimError as error:
            log.warning("%s", error)
            return self._refuse(HTTPStatus.INTERNAL_SERVER_ERROR)
        if content is None:
            return self._refuse(HTTPStatus.NOT_FOUND)
        kind = name.rpartition(".")[2]
        packed = kind not in ("jpg",) and "gzip" in self.headers.get("Accept-Encoding", "")
        self._send(HTTPStatus.OK, gzip.compress(content, 1) if packed else content, kind, with_content, packed)
        return None

    def _asked_by_name(self) -> bool:
        """Whether the request names this machine: a foreign name that leads here is a trick of another page."""
        host = self.headers.get("Host", "").rpartition(":")[0]
        return host in (HOST, "localhost")

    def _refuse(self, status: HTTPStatus) -> None:
        self._send(status, f"{status.value} {status.phrase}\n".encode(), "txt", self.command != "HEAD", packed=False)

    def _send(self, status: HTTPStatus, content: bytes, kind: str, with_content: bool, packed: bool) -> None:
        self.send_response(status)
        self.send_header("Content-Type", TYPES.get(kind, TYPES["txt"]))
        self.send_header("Content-Length", str(len(content)))
        if packed:
            self.send_header("Content-Encoding", "gzip")
        # Pictures are asked for whenever the page is scrolled; tables and the page itself may be made anew meanwhile.
        self.send_header("Cache-Control", "private, max-age=600" if kind == "jpg" else "no-cache")
        for name, value in HEADERS.items():
            self.send_header(name, value)
        self.end_headers()
        if with_content:
            self.wfile.write(content)

    def log_message(self, format: str, *values: Any) -> None:  # noqa: A002
        log.debug(format, *values)
