"""Local HTTP server (127.0.0.1) for the files of the page and for corrections of the run."""

from __future__ import annotations

import json
import logging
import os
import secrets
import sys
import threading
import zlib
from collections.abc import Callable, Mapping
from functools import lru_cache
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from polarsim.errors import ConfigError, LabelError, PolarsimError
from polarsim.explore.corrections import Corrections
from polarsim.explore.site import CORRECTIONS, NEXT_RUN, Files, corrections_content

log = logging.getLogger("polarsim")

HOST = "127.0.0.1"  # local interface only, for security
FIRST_PORT, PORTS = 20000, 10000  # usual ports of runs, below the ports that systems assign to connections
MAX_CACHED_FILES = 1000  # images have about 0.2 MB
MAX_REQUEST_BYTES = 1 << 20  # maximum size of the boxes of a photo
MAX_DISCARDED_BYTES = 8 << 20  # maximum content of a refused request that is read before the connection is closed
MAX_WORKERS = max(4, os.cpu_count() or 1)  # maximum number of files computed in parallel
PROOF_HEADER = "X-Polarsim-Token"
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


_CORRECTION_PREFIX = f"/{CORRECTIONS.removesuffix('.json')}/"  # of the addresses of single photos


class FileCache:
    """Contents of the most recently used files. Files other than images are computed again for a new `version`."""

    def __init__(
        self, files: Files, max_files: int = MAX_CACHED_FILES, version: Callable[[], object] = lambda: None
    ) -> None:
        self._files, self._workers, self._version = files, threading.BoundedSemaphore(MAX_WORKERS), version
        self._cached = lru_cache(max_files)(self._computed)

    def read(self, name: str) -> bytes | None:
        """Return the content of an address, or None for an unknown address."""
        if name not in self._files:
            return None
        return self._cached(name, None if name.endswith(".jpg") else self._version())

    def _computed(self, name: str, _version: object) -> bytes:
        with self._workers:
            return self._files[name]()


def server(files: Files, port: int = 0, corrections: Corrections | None = None) -> Server:
    """Return a bound server that is not running yet; port 0 selects a free port.

    Without `corrections`, the server accepts no changes.
    """
    cache = FileCache(files, version=corrections.labels_version) if corrections else FileCache(files)

    class Handler(_Handler):
        content = cache
        saved = corrections
        token = secrets.token_urlsafe(32)  # secret: pages of other origins cannot read the server's answers

    try:
        return Server((HOST, port), Handler)
    except OSError as error:
        raise ConfigError(f"port {port} of {HOST} is not available ({error.strerror}): choose a --port") from error


def server_of_run(folder: Path, files: Files, port: int | None, corrections: Corrections) -> Server:
    """Return the server of a run; without a port, at the port of the run's folder, or at a free port if it is in use.

    Browsers store the state of a page by host and port.
    """
    if port is not None:
        return server(files, port, corrections)
    usual = FIRST_PORT + zlib.crc32(str(folder.resolve()).encode()) % PORTS
    try:
        return server(files, usual, corrections)
    except ConfigError:
        log.warning("port %d of this run is in use, probably by another explorer of the run: using a free port", usual)
        return server(files, 0, corrections)


class Server(ThreadingHTTPServer):
    """HTTP server with a thread per connection. At Ctrl-C, the command ends the process with all threads."""

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore connections that are closed by the browser."""
        if not isinstance(sys.exc_info()[1], ConnectionError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    """Request handler: GET of listed addresses, compared literally without decoding.

    PUT and DELETE of `data/corrections/KEY` save and remove the boxes of a photo. PUT of `data/next_run.json` writes
    the overlay of the next run. They require the token in `data/corrections.json`, which pages of other origins cannot
    read.
    """

    content: FileCache
    saved: Corrections | None
    token: str
    protocol_version = "HTTP/1.1"
    wbufsize = 1 << 16  # sends header and content together; separate packets cost 40 ms (delayed acknowledgement)
    server_version, sys_version = "polarsim", ""

    def do_GET(self) -> None:  # called by http.server
        if not self._is_local_host():
            return self._refuse(HTTPStatus.MISDIRECTED_REQUEST)
        name = self.path.partition("?")[0].removeprefix("/") or "index.html"
        try:
            if name == CORRECTIONS and self.saved:
                content: bytes | None = corrections_content(
                    self.saved, self.token
                )  # not cached: other programs write these files
            else:
                content = self.content.read(name)
        except PolarsimError as error:
            log.warning("%s", error)
            return self._refuse(HTTPStatus.INTERNAL_SERVER_ERROR, str(error) if name == CORRECTIONS else "")
        if content is None:
            return self._refuse(HTTPStatus.NOT_FOUND)
        return self._send(HTTPStatus.OK, content, name.rpartition(".")[2])

    def do_PUT(self) -> None:
        self._change()

    def do_DELETE(self) -> None:
        self._change()

    def _change(self) -> None:
        """Save or remove the correction of a photo, or write the overlay of the next run."""
        self.close_connection = True  # some content of a refused request may not be read
        name = self.path.removeprefix(_CORRECTION_PREFIX)
        status = self._refusal(name)
        if status:
            self._refuse(status)
            return self._discard_content()
        assert self.saved is not None
        try:
            answer = {}
            if self._prepares_run():
                self._request_content()
                answer = self.saved.prepare_run()
            elif self.command == "PUT":
                self.saved.save(name, self._request_content())
            else:
                self.saved.drop(name)
            answer["version"] = self.saved.version()
        except LabelError as error:
            return self._refuse(HTTPStatus.UNPROCESSABLE_ENTITY, str(error))
        except PolarsimError as error:
            log.warning("%s", error)
            return self._refuse(HTTPStatus.INTERNAL_SERVER_ERROR, str(error))
        return self._send(HTTPStatus.OK, json.dumps(answer).encode(), "json")

    def _prepares_run(self) -> bool:
        return self.command == "PUT" and self.path == f"/{NEXT_RUN}"

    def _refusal(self, name: str) -> HTTPStatus | None:
        """Return the status of a refused change of a photo, or None for a valid request of this server's page."""
        if not self._is_local_host():
            return HTTPStatus.MISDIRECTED_REQUEST
        if self.saved is None:
            return HTTPStatus.NOT_IMPLEMENTED
        origin = f"http://{self.headers.get('Host')}"
        same_origin = self.headers.get("Origin", origin) == origin
        same_origin &= self.headers.get("Sec-Fetch-Site", "same-origin") == "same-origin"
        token = self.headers.get(PROOF_HEADER, "").encode()
        if not same_origin or not secrets.compare_digest(token, self.token.encode()):
            return HTTPStatus.FORBIDDEN
        if not self._prepares_run() and (not self.path.startswith(_CORRECTION_PREFIX) or name not in self.saved):
            return HTTPStatus.NOT_FOUND
        if self.command == "DELETE":
            return None
        if self.headers.get("Content-Type", "").partition(";")[0].strip().lower() != "application/json":
            return HTTPStatus.UNSUPPORTED_MEDIA_TYPE
        length = self.headers.get("Content-Length", "")
        if not (length.isascii() and length.isdigit()) or "Transfer-Encoding" in self.headers:
            return HTTPStatus.LENGTH_REQUIRED
        return HTTPStatus.REQUEST_ENTITY_TOO_LARGE if int(length[:12]) > MAX_REQUEST_BYTES else None

    def _request_content(self) -> object:
        """Read the JSON content of a request."""
        length = int(self.headers["Content-Length"])
        content = self.rfile.read(length)
        try:
            if len(content) < length:
                raise ValueError("incomplete")
            return json.loads(content)
        except (ValueError, RecursionError) as error:
            raise LabelError(f"invalid boxes: {error}") from error

    def _discard_content(self) -> None:
        """Read the content of a refused request, at most `MAX_DISCARDED_BYTES`.

        Closing the connection before that resets it, and the client does not receive the answer.
        """
        self.wfile.flush()
        length = self.headers.get("Content-Length", "")
        left = min(int(length[:12]), MAX_DISCARDED_BYTES) if length.isascii() and length.isdigit() else 0
        while left > 0 and (part := self.rfile.read(min(left, 1 << 16))):
            left -= len(part)

    def _is_local_host(self) -> bool:
        """Return whether the request names the local host; other names indicate DNS rebinding."""
        host = self.headers.get("Host", "").rpartition(":")[0]
        return host in (HOST, "localhost")

    def _refuse(self, status: HTTPStatus, reason: str = "") -> None:
        text = reason or f"{status.value} {status.phrase}"
        self._send(status, f"{text}\n".encode(), "txt")

    def _send(self, status: HTTPStatus, content: bytes, kind: str) -> None:
        self.send_response(status)
        self.send_header("Content-Type", TYPES.get(kind, TYPES["txt"]))
        self.send_header("Content-Length", str(len(content)))
        if self.close_connection:
            self.send_header("Connection", "close")
        # Images are requested while scrolling and may be cached; tables and the page may change.
        self.send_header("Cache-Control", "private, max-age=600" if kind == "jpg" else "no-cache")
        for name, value in HEADERS.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, format: str, *values: Any) -> None:  # noqa: A002
        log.debug(format, *values)
