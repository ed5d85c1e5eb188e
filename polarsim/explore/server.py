"""The page on this machine: an HTTP server on 127.0.0.1 for a list of addresses, and for corrections of the run."""

from __future__ import annotations

import gzip
import json
import logging
import os
import secrets
import socket
import sys
import threading
import time
from collections import OrderedDict
from collections.abc import Mapping
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from socketserver import TCPServer
from typing import Any

from polarsim.errors import ConfigError, LabelError, PolarsimError
from polarsim.explore.corrections import Corrections
from polarsim.explore.site import CORRECTIONS, Files, corrections_content

log = logging.getLogger("polarsim")

HOST = "127.0.0.1"  # never another one: nobody but this machine's users is asked in
MOST_KEPT = 256 << 20  # bytes of files that were asked for and may be asked for again
MOST_SENT = 1 << 20  # bytes of the boxes of one photo
MOST_AT_ONCE = max(4, os.cpu_count() or 1)  # files that are made at the same time
END_S = 10.0  # maximum time that requests in progress have to end
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


_BELOW = f"/{CORRECTIONS.removesuffix('.json')}/"  # where each photo's correction has its address


class Kept:
    """What files hold, made once and kept while there is room."""

    def __init__(self, files: Files, most: int = MOST_KEPT) -> None:
        self._files, self._most, self._size = files, most, 0
        self._kept: OrderedDict[str, bytes] = OrderedDict()
        self._lock = threading.Lock()
        self._making = threading.BoundedSemaphore(MOST_AT_ONCE)
        self._closed = False

    def close(self) -> None:
        """Refuse all further reads, those that wait for their turn included."""
        self._closed = True

    def read(self, name: str) -> bytes | None:
        """The content of an address; None where there is no such one.

        Raises
        ------
        ConnectionAbortedError
            The server ends.
        """
        if name not in self._files:
            return None
        with self._lock:
            if name in self._kept:
                self._kept.move_to_end(name)
                return self._kept[name]
        with self._making:
            if self._closed:
                raise ConnectionAbortedError
            content = self._files[name]()
        with self._lock:
            self._size += len(content) - len(self._kept.get(name, b""))
            self._kept[name] = content
            while self._size > self._most and len(self._kept) > 1:
                self._size -= len(self._kept.popitem(last=False)[1])
        return content


def server(files: Files, port: int = 0, corrections: Corrections | None = None) -> Server:
    """A server that is bound and not yet running; port 0 takes a free one.

    Without `corrections`, nothing can be sent to it.

    Raises
    ------
    ConfigError
        The port is taken.
    """
    kept = Kept(files)

    class Handler(_Handler):
        content = kept
        saved = corrections
        token = secrets.token_urlsafe(32)  # known to the page alone: foreign pages cannot read what this server answers

    try:
        return Server((HOST, port), Handler)
    except OSError as error:
        raise ConfigError(f"port {port} of {HOST} cannot be used, {error.strerror}: name another by --port") from error


class Server(ThreadingHTTPServer):
    """Answers each connection in a thread, and waits for its threads at the end.

    A thread that is in a C++ library while the interpreter ends makes the process abort, so that no thread is a daemon.
    """

    daemon_threads, block_on_close = False, False  # `server_close` has its own, bounded way of waiting

    def __init__(self, address: tuple[str, int], handler: type[_Handler]) -> None:
        self._content = handler.content
        self._connections: dict[threading.Thread, socket.socket] = {}
        self._guard, self._closed = threading.Lock(), False
        super().__init__(address, handler)

    def serve_until_stopped(self) -> None:
        """Serve until `KeyboardInterrupt`, which is raised here and never in the middle of accepting a connection."""
        accepting = threading.Thread(target=self.serve_forever, args=(0.1,))
        accepting.start()
        try:
            while accepting.is_alive():
                accepting.join(1)
        finally:
            self.shutdown()
            accepting.join()

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Answer a connection; the server knows of it meanwhile."""
        with self._guard:
            self._connections[threading.current_thread()] = request
            ended = self._closed
        try:
            if ended:
                self.shutdown_request(request)
            else:
                super().process_request_thread(request, client_address)
        finally:
            with self._guard:
                del self._connections[threading.current_thread()]

    def server_close(self) -> None:
        """Close the port and all connections, and wait at most `END_S` for requests in progress."""
        TCPServer.server_close(self)
        self._content.close()
        with self._guard:
            self._closed = True
            for connection in self._connections.values():
                try:
                    connection.shutdown(socket.SHUT_RDWR)
                except OSError:
                    continue  # closed already
            threads = list(self._connections)
        deadline = time.monotonic() + END_S
        for thread in threads:
            thread.join(max(0.0, deadline - time.monotonic()))

    @property
    def busy(self) -> bool:
        """Whether a request is in progress."""
        with self._guard:
            return bool(self._connections)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A browser that left while it was answered is no error."""
        if not isinstance(sys.exc_info()[1], ConnectionError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    """Answers GET and HEAD for addresses that are in the list, letter by letter; nothing is decoded or joined.

    PUT and DELETE of `data/corrections/KEY` save and remove the boxes of a photo. They need the token that the page
    read in `data/corrections.json`, so that no other page can send them.
    """

    content: Kept
    saved: Corrections | None
    token: str
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
            if name == CORRECTIONS and self.saved:
                content: bytes | None = corrections_content(self.saved, self.token)  # anew: others write the files too
            else:
                content = self.content.read(name)
        except PolarsimError as error:
            log.warning("%s", error)
            return self._refuse(HTTPStatus.INTERNAL_SERVER_ERROR, str(error) if name == CORRECTIONS else "")
        if content is None:
            return self._refuse(HTTPStatus.NOT_FOUND)
        kind = name.rpartition(".")[2]
        packed = kind not in ("jpg",) and "gzip" in self.headers.get("Accept-Encoding", "")
        self._send(HTTPStatus.OK, gzip.compress(content, 1) if packed else content, kind, with_content, packed)
        return None

    def do_PUT(self) -> None:
        self._change()

    def do_DELETE(self) -> None:
        self._change()

    def _change(self) -> None:
        """Save or remove the correction of one photo."""
        self.close_connection = True  # a refused request may have content that nobody reads
        refused = self._why_refused()
        if refused:
            return self._refuse(refused)
        assert self.saved is not None
        name = self.path.removeprefix(_BELOW)
        if not self.path.startswith(_BELOW) or name not in self.saved:
            return self._refuse(HTTPStatus.NOT_FOUND)
        try:
            if self.command == "PUT":
                self.saved.save(name, self._sent())
            else:
                self.saved.drop(name)
        except LabelError as error:
            return self._refuse(HTTPStatus.UNPROCESSABLE_ENTITY, str(error))
        except PolarsimError as error:
            log.warning("%s", error)
            return self._refuse(HTTPStatus.INTERNAL_SERVER_ERROR, str(error))
        self._send(HTTPStatus.OK, b"{}", "json", with_content=True, packed=False)
        return None

    def _why_refused(self) -> HTTPStatus | None:
        """The status that refuses a request to change something; None where the page of this server sent it."""
        if not self._asked_by_name():
            return HTTPStatus.MISDIRECTED_REQUEST
        if self.saved is None:
            return HTTPStatus.NOT_IMPLEMENTED
        own = f"http://{self.headers.get('Host')}"
        from_own_page = self.headers.get("Origin", own) == own
        from_own_page &= self.headers.get("Sec-Fetch-Site", "same-origin") == "same-origin"
        token = self.headers.get(PROOF_HEADER, "").encode()
        if not from_own_page or not secrets.compare_digest(token, self.token.encode()):
            return HTTPStatus.FORBIDDEN
        if self.command == "DELETE":
            return None
        if self.headers.get("Content-Type", "").partition(";")[0].strip().lower() != "application/json":
            return HTTPStatus.UNSUPPORTED_MEDIA_TYPE
        length = self.headers.get("Content-Length", "")
        if not (length.isascii() and length.isdigit()) or "Transfer-Encoding" in self.headers:
            return HTTPStatus.LENGTH_REQUIRED
        return HTTPStatus.REQUEST_ENTITY_TOO_LARGE if int(length[:12]) > MOST_SENT else None

    def _sent(self) -> object:
        """The content of a request.

        Raises
        ------
        LabelError
            It is no JSON, or its end is missing.
        """
        length = int(self.headers["Content-Length"])
        content = self.rfile.read(length)
        try:
            if len(content) < length:
                raise ValueError("incomplete")
            return json.loads(content)
        except (ValueError, RecursionError) as error:
            raise LabelError(f"no readable boxes, {error}") from error

    def _asked_by_name(self) -> bool:
        """Whether the request names this machine: a foreign name that leads here is a trick of another page."""
        host = self.headers.get("Host", "").rpartition(":")[0]
        return host in (HOST, "localhost")

    def _refuse(self, status: HTTPStatus, reason: str = "") -> None:
        text = reason or f"{status.value} {status.phrase}"
        self._send(status, f"{text}\n".encode(), "txt", self.command != "HEAD", packed=False)

    def _send(self, status: HTTPStatus, content: bytes, kind: str, with_content: bool, packed: bool) -> None:
        self.send_response(status)
        self.send_header("Content-Type", TYPES.get(kind, TYPES["txt"]))
        self.send_header("Content-Length", str(len(content)))
        if packed:
            self.send_header("Content-Encoding", "gzip")
        if self.close_connection:
            self.send_header("Connection", "close")
        # Pictures are asked for whenever the page is scrolled; tables and the page itself may be made anew meanwhile.
        self.send_header("Cache-Control", "private, max-age=600" if kind == "jpg" else "no-cache")
        for name, value in HEADERS.items():
            self.send_header(name, value)
        self.end_headers()
        if with_content:
            self.wfile.write(content)

    def log_message(self, format: str, *values: Any) -> None:  # noqa: A002
        log.debug(format, *values)
