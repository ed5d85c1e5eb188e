"""What the server answers, asked byte by byte: a client library would put paths right before it sends them."""

import gzip
import re
import socket
import threading
from http.client import HTTPConnection
from pathlib import Path

import pytest

import polarsim
from polarsim.errors import ConfigError, FormatError
from polarsim.explore.server import HOST, Kept, server


def broken():
    raise FormatError("no readable picture", path="x.png")


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    secret = tmp_path_factory.mktemp("outside") / "secret.txt"
    secret.write_text("secret")
    link = tmp_path_factory.mktemp("inside") / "link.txt"
    link.symlink_to(secret)
    files = {"index.html": lambda: b"<!doctype html>", "data/a.json": lambda: b"{}", "data/broken.jpg": broken}
    with server(files) as running:
        running.outside = secret, link
        thread = threading.Thread(target=running.serve_forever, daemon=True)
        thread.start()
        yield running
        running.shutdown()
        thread.join()


def asked(served, target: str, method: str = "GET", host: str | None = None, **headers: str):
    connection = HTTPConnection(HOST, served.server_address[1], timeout=10)
    connection.putrequest(method, target, skip_host=True, skip_accept_encoding=True)
    connection.putheader("Host", host or f"{HOST}:{served.server_address[1]}")
    for name, value in headers.items():
        connection.putheader(name.replace("_", "-"), value)
    connection.endheaders()
    answer = connection.getresponse()
    content = answer.read()
    connection.close()
    return answer, content


def test_it_listens_on_this_machine_alone(served):
    assert served.server_address[0] == HOST == "127.0.0.1"
    own = socket.gethostbyname(socket.gethostname())
    if not own.startswith("127."):
        with (
            pytest.raises(ConnectionRefusedError),
            socket.create_connection((own, served.server_address[1]), timeout=2),
        ):
            pass


@pytest.mark.parametrize("target", ["/", "/index.html", "/index.html?a=1"])
def test_what_is_in_the_list_is_answered(served, target):
    answer, content = asked(served, target)
    assert (answer.status, content) == (200, b"<!doctype html>")
    assert answer.headers["Content-Type"].startswith("text/html")
    assert "default-src 'self'" in answer.headers["Content-Security-Policy"]


@pytest.mark.parametrize(
    "target",
    [
        "/../../etc/passwd", "/..%2f..%2fetc%2fpasswd", "/%2e%2e/%2e%2e/etc/passwd", "//etc/passwd", "/etc/passwd",
        "/data/../index.html", "/data%2fa.json", "/data//a.json", "/./index.html", "/data/", "/data", "/data\\a.json",
        "/index.html%00.jpg", "/INDEX.HTML", "file:///etc/passwd", "/~root/.ssh/id_rsa", "/data/a.json/",
        "/%252e%252e/etc/passwd", "/data%5ca.json", "/%2fetc%2fpasswd", "/..;/etc/passwd",
    ],
)  # fmt: skip
def test_everything_else_has_no_file(served, target):
    answer, content = asked(served, target)
    assert answer.status == 404
    assert content == b"404 Not Found\n"


def test_neither_files_nor_links_of_the_disk_are_reached(served):
    for path in served.outside:
        for target in (str(path), f"/..{path}", f"/{'../' * 12}{path}", f"/data/..%2f..{path}"):
            answer, content = asked(served, target)
            assert answer.status == 404
            assert b"secret" not in content


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1.evil.example:80", "[::1]:80", ""])
def test_a_foreign_name_that_leads_here_is_refused(served, host):
    answer, _ = asked(served, "/index.html", host=host or "0.0.0.0:80")
    assert answer.status == 421


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS", "TRACE", "CONNECT"])
def test_nothing_can_be_sent_to_it(served, method):
    assert asked(served, "/index.html", method)[0].status == 501


def test_head_tells_the_size_without_the_content(served):
    answer, content = asked(served, "/data/a.json", "HEAD")
    assert (answer.status, answer.headers["Content-Length"], content) == (200, "2", b"")


def test_texts_are_packed_for_those_who_ask(served):
    answer, content = asked(served, "/index.html", Accept_Encoding="gzip")
    assert answer.headers["Content-Encoding"] == "gzip"
    assert gzip.decompress(content) == b"<!doctype html>"


def test_a_broken_picture_is_one_answer_and_no_end(served, caplog):
    assert asked(served, "/data/broken.jpg")[0].status == 500
    assert "x.png: no readable picture" in caplog.text
    assert asked(served, "/")[0].status == 200


def test_a_taken_port_is_said_in_one_line(served):
    with pytest.raises(ConfigError, match="name another by --port"):
        server({}, served.server_address[1])


def test_what_was_made_is_kept_while_there_is_room():
    made = []
    files = {name: lambda name=name: made.append(name) or bytes(10) for name in "abc"}
    kept = Kept(files, most=20)
    for name in "aabac":
        kept.read(name)
    assert made == ["a", "b", "c"]
    kept.read("b")  # the one that was not asked for longest had to go
    assert made == ["a", "b", "c", "b"]
    assert kept.read("d") is None


def test_no_other_module_of_polarsim_listens():
    opens = re.compile(
        r"(from|import) (http\.server|socketserver)|import (socket|asyncio|flask|uvicorn|aiohttp|websockets|tornado)\b"
    )
    package = Path(polarsim.__file__).parent
    found = [path.relative_to(package) for path in package.rglob("*.py") if opens.search(path.read_text())]
    assert found == [Path("explore/server.py")]
