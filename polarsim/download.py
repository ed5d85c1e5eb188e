"""Downloads by HTTP, with retries and resumption.

An interrupted download remains in a hidden file next to the target. The next attempt, also of a later run, requests
only the missing bytes if the file on the server is unchanged. Proxies are set by `http_proxy` and `https_proxy`.
"""

from __future__ import annotations

import errno
import fcntl
import logging
import os
import shutil
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from http.client import HTTPException, HTTPMessage
from pathlib import Path
from typing import IO, Any

from polarsim.errors import FetchError
from polarsim.formats.files import write_text
from polarsim.progress import progress_bar

CHUNK = 1 << 20  # maximum number of bytes per read
SLOWEST = 1000  # minimum bytes per second, averaged over `timeout_s`
_FOR_GOOD = (301, 302, 303, 307, 308, 400, 401, 403, 404, 405, 407, 410)  # status codes that are final: no retry
_DISK = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM, errno.EFBIG)

log = logging.getLogger("polarsim")


class _TransferError(Exception):
    """An attempt failed, and a further attempt may succeed."""


class _Redirects(urllib.request.HTTPRedirectHandler):
    """Allow redirects to any host, because checksums are verified, but not from https to http."""

    def redirect_request(
        self, req: urllib.request.Request, fp: IO[bytes], code: int, msg: str, headers: HTTPMessage, newurl: str
    ) -> urllib.request.Request | None:
        allowed = ("https://",) if req.full_url.startswith("https://") else ("http://", "https://")
        if not newurl.lower().startswith(allowed):
            raise urllib.error.HTTPError(req.full_url, code, f"and redirects to {newurl}", headers, fp)
        return super().redirect_request(req, fp, code, msg, headers, newurl)


@contextmanager
def downloaded_file(
    url: str, path: Path, tries: int = 5, backoff_s: float = 2.0, timeout_s: float = 60.0
) -> Iterator[Path]:
    """Download a URL to a hidden file; rename the file to `path` at the end of the block, or remove it on an error.

    The block verifies the file. Only one process at a time may download to a path, see `exclusive_lock`.

    Parameters
    ----------
    tries
        Maximum number of attempts.
    backoff_s
        Pause before the second attempt, seconds; doubles with every further attempt.
    timeout_s
        Maximum time without data, and averaging time of the minimum rate `SLOWEST`, seconds.
    """
    partial = path.with_name(f".{path.name}.part")
    _download(url, partial, 1 if url.startswith("file:") else tries, backoff_s, timeout_s)
    try:
        yield partial
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)
        _validator_of(partial).unlink(missing_ok=True)


def _download(url: str, partial: Path, tries: int, backoff_s: float, timeout_s: float) -> None:
    for number in range(1, tries + 1):
        try:
            _transfer(url, partial, timeout_s)
            return
        except urllib.error.HTTPError as error:
            reason = f"the server answers {error.code} {error.reason}"
            if error.code in _FOR_GOOD:
                raise FetchError(f"{url}: {' '.join(reason.split())}") from error
        except (_TransferError, HTTPException, OSError, ValueError) as error:
            if isinstance(error, OSError) and error.errno in _DISK:
                raise FetchError(f"cannot be written, {error.strerror}", path=partial) from error
            reason = " ".join(str(getattr(error, "reason", error)).split()) or type(error).__name__
        if number < tries:
            log.warning("%s: try %d of %d failed, %s", url, number, tries, reason)
            time.sleep(backoff_s * 2 ** (number - 1))
    raise FetchError(f"{url}: {tries} tries failed, the last with: {reason}")


def _transfer(url: str, partial: Path, timeout_s: float) -> None:
    """Append the missing bytes of a file, or download the entire file if it has changed on the server."""
    request = urllib.request.Request(url)  # noqa: S310 (options allow http, https and, of weights, file only)
    start = partial.stat().st_size if partial.exists() else 0
    validator = _validator_of(partial)
    if start and validator.exists():
        request.add_header("Range", f"bytes={start}-")
        request.add_header("If-Range", validator.read_text(encoding="ascii"))
    else:
        start = 0
    try:
        response = urllib.request.build_opener(_Redirects).open(request, timeout=timeout_s)
    except urllib.error.HTTPError as error:
        if error.code != 416:  # range not satisfiable: the file is complete or has changed
            raise
        if error.headers.get("Content-Range") == f"bytes */{start}":
            return
        partial.unlink()
        raise _TransferError("the file on the server has changed") from error
    with response:
        if response.status != 206:
            start = 0
        elif not response.headers.get("Content-Range", "").startswith(f"bytes {start}-"):
            raise _TransferError("the server sent another part of the file than requested")
        _keep_validator(response, validator)
        stated = response.headers.get("Content-Length")
        length = int(stated) if stated else None
        _check_room(partial, length or 0)
        with partial.open("ab" if start else "wb") as file:
            for chunk in _chunks(response, length, partial.name, timeout_s):
                file.write(chunk)
    received = partial.stat().st_size - start
    if length is not None and received != length:
        raise _TransferError(f"the connection ended after {received} of {length} bytes")


def _check_room(partial: Path, needed: int) -> None:
    free = shutil.disk_usage(partial.parent).free
    if needed > free:
        raise FetchError(f"has {needed / 1e6:.0f} MB, the disk has {free / 1e6:.0f} MB free", path=partial)


def _chunks(response: Any, length: int | None, name: str, timeout_s: float) -> Iterator[bytes]:
    """Yield the received bytes; raise an error if the average rate is below `SLOWEST`."""
    received, counted, started = 0, 0, time.monotonic()
    with progress_bar(f"fetching {name.removeprefix('.').removesuffix('.part')}") as report:
        while chunk := response.read1(CHUNK):
            yield chunk
            received += len(chunk)
            if length:
                report(received / length)
            if (passed := time.monotonic() - started) > timeout_s:
                if received - counted < SLOWEST * passed:
                    raise _TransferError(f"the server sends {(received - counted) / passed:.0f} bytes a second")
                started, counted = time.monotonic(), received


def _validator_of(partial: Path) -> Path:
    """Return the path of the file with the version (ETag or date) of a partial download."""
    return partial.with_suffix(".version")


def _keep_validator(response: Any, path: Path) -> None:
    """Store the version of a file. A weak ETag does not guarantee equal bytes (RFC 9110, 13.1.5), so it is ignored."""
    tag = response.headers.get("ETag", "")
    value = tag if tag and not tag.startswith("W/") else response.headers.get("Last-Modified")
    if value:
        write_text(path, value)
    else:
        path.unlink(missing_ok=True)


@contextmanager
def exclusive_lock(root: Path) -> Iterator[None]:
    """Lock a folder for one process, because several jobs share a download; the lock ends with the process."""
    try:
        root.mkdir(parents=True, exist_ok=True)
        folder = os.open(root, os.O_RDONLY)
    except OSError as error:
        raise FetchError(f"cannot be opened, {error.strerror}", path=root) from error
    try:
        with suppress(OSError):  # a file system without locks
            fcntl.flock(folder, fcntl.LOCK_EX)
        yield
    finally:
        os.close(folder)
