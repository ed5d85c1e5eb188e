"""Answers of the server to raw requests; client libraries would normalise paths."""

import json
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from http.client import HTTPConnection
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import polarsim
from polarsim.errors import ConfigError, FormatError, LabelError
from polarsim.explore.corrections import Corrections
from polarsim.explore.server import HOST, MAX_REQUEST_BYTES, FileCache, server, server_of_run
from polarsim.formats import yolo
from polarsim.formats.coco import write_coco
from polarsim.formats.files import write_text
from polarsim.labels.seeds import read_corrections
from polarsim.run_files.run import Run
from polarsim.site import polar
from tests.support.polar_photos import HEIGHT, SIZE, WIDTH

from .made_run import KEYS, SEED, boxes_of


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


def asked(served, target: str, method: str = "GET", host: str | None = None, content: bytes = b"", **headers: str):
    connection = HTTPConnection(HOST, served.server_address[1], timeout=10)
    connection.putrequest(method, target, skip_host=True, skip_accept_encoding=True)
    connection.putheader("Host", host or f"{HOST}:{served.server_address[1]}")
    for name, value in headers.items():
        connection.putheader(name.replace("_", "-"), value)
    connection.endheaders(content)
    answer = connection.getresponse()
    content = answer.read()
    connection.close()
    return answer, content


def test_it_listens_on_the_local_interface_only(served):
    assert served.server_address[0] == HOST == "127.0.0.1"
    own = socket.gethostbyname(socket.gethostname())
    if not own.startswith("127."):
        with (
            pytest.raises(ConnectionRefusedError),
            socket.create_connection((own, served.server_address[1]), timeout=2),
        ):
            pass


@pytest.mark.parametrize("target", ["/", "/index.html", "/index.html?a=1"])
def test_listed_addresses_are_answered(served, target):
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
def test_other_addresses_are_not_found(served, target):
    answer, content = asked(served, target)
    assert answer.status == 404
    assert content == b"404 Not Found\n"


def test_files_and_links_on_the_disk_are_not_served(served):
    for path in served.outside:
        for target in (str(path), f"/..{path}", f"/{'../' * 12}{path}", f"/data/..%2f..{path}"):
            answer, content = asked(served, target)
            assert answer.status == 404
            assert b"secret" not in content


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1.evil.example:80", "[::1]:80", ""])
def test_other_host_names_are_refused(served, host):
    answer, _ = asked(served, "/index.html", host=host or "0.0.0.0:80")
    assert answer.status == 421


@pytest.mark.parametrize("method", ["HEAD", "POST", "PUT", "DELETE", "OPTIONS", "TRACE", "CONNECT"])
def test_other_methods_are_refused(served, method):
    assert asked(served, "/index.html", method)[0].status == 501


def test_an_invalid_image_is_an_error_of_a_single_request(served, caplog):
    assert asked(served, "/data/broken.jpg")[0].status == 500
    assert "x.png: no readable picture" in caplog.text
    assert asked(served, "/")[0].status == 200


def test_a_port_in_use_is_an_error(served):
    with pytest.raises(ConfigError):
        server({}, served.server_address[1])


def test_the_cache_drops_the_least_recently_used_files():
    made = []
    files = {name: lambda name=name: made.append(name) or bytes(10) for name in "abc"}
    kept = FileCache(files, max_files=2)
    for name in "aabac":
        kept.read(name)
    assert made == ["a", "b", "c"]
    kept.read("b")  # the least recently used file was dropped
    assert made == ["a", "b", "c", "b"]
    assert kept.read("d") is None


def test_no_other_module_of_polarsim_listens():
    opens = re.compile(
        r"(from|import) (http\.server|socketserver)|import (socket|asyncio|flask|uvicorn|aiohttp|websockets|tornado)\b"
    )
    package = Path(polarsim.__file__).parent
    found = [path.relative_to(package) for path in package.rglob("*.py") if opens.search(path.read_text())]
    forks = Path("running/forks.py")  # a socket in the file system, only for the same user
    assert sorted(found) == [Path("explore/server.py"), forks]
    text = (package / forks).read_text()
    assert text.count("socket.socket(") == text.count("socket.socket(socket.AF_UNIX)") == 2


@pytest.fixture
def run(corrected):
    return Run.at(corrected)


@contextmanager
def correcting(run: Run):
    with server({"index.html": lambda: b""}, corrections=Corrections(run)) as running:
        thread = threading.Thread(target=running.serve_forever, args=(0.02,))
        thread.start()
        yield running
        running.shutdown()
        thread.join()


def corrections_of(running) -> dict:
    answer, content = asked(running, "/data/corrections.json")
    assert answer.status == 200, content
    return json.loads(content)


def change(running, key=SEED, method="PUT", boxes: object = (), **headers: str):
    """Send boxes as the page does; `headers` replace the page's headers, None omits a header."""
    content = boxes if isinstance(boxes, bytes) else json.dumps(list(boxes)).encode()
    content = content if method == "PUT" else b""
    usual = {
        "X_Polarsim_Token": running.RequestHandlerClass.token,
        "Content_Type": "application/json",
        "Content_Length": str(len(content)),
        "Origin": f"http://{HOST}:{running.server_address[1]}",
        "Sec_Fetch_Site": "same-origin",
    } | headers
    sent = {name: value for name, value in usual.items() if value is not None}
    return asked(running, f"/data/corrections/{key}", method, content=content, **sent)


def box(kind="rock", x0=10.0, y0=20.0, x1=40.0, y1=60.0, **more) -> dict:
    return {"kind": kind, "x0": x0, "y0": y0, "x1": x1, "y1": y1, **more}


def files(run: Run) -> list[str]:
    return sorted(str(path.relative_to(run.folder)) for path in (run.folder / "corrections").rglob("*"))


def test_a_saved_correction_is_read_by_the_next_run_and_the_next_server(run):
    rock, shadow = boxes_of(SEED)["rock", 1] + 3, boxes_of(SEED)["shadow", 2]
    edges = ("x0", "y0", "x1", "y1")
    sent = [box("rock", *rock), box("shadow", *shadow), box("rock", 0, 0, WIDTH, HEIGHT), box("rock", 5, 6, 7.5, 9)]
    with correcting(run) as running:
        assert corrections_of(running)["photos"] == {}
        assert change(running, boxes=sent)[0].status == 200
        assert change(running, KEYS[1], boxes=[])[0].status == 200  # no rocks and shadows
    found = read_corrections(run.folder / "corrections", polar(), 3)
    assert set(found) == {SEED, KEYS[1]}
    np.testing.assert_allclose(found[SEED].rocks, [rock, [0, 0, WIDTH, HEIGHT], [5, 6, 7.5, 9]], atol=2e-3)
    np.testing.assert_allclose(found[SEED].shadows, [shadow], atol=2e-3)
    with correcting(Run.at(run.folder)) as running:  # new port and token
        photos = corrections_of(running)["photos"]
        assert set(photos) == {str(SEED), str(KEYS[1])}
        assert photos[str(KEYS[1])] == []
        assert {(one["kind"], one["rock"]) for one in photos[str(SEED)]} == {("rock", 1), ("shadow", 2), ("rock", -1)}
        np.testing.assert_allclose([photos[str(SEED)][0][edge] for edge in edges], rock, atol=2e-3)
        assert change(running, boxes=[box(**one) for one in photos[str(SEED)]])[0].status == 200
        assert change(running, method="DELETE")[0].status == 200
        assert change(running, method="DELETE")[0].status == 200  # of a photo without a correction
        assert set(corrections_of(running)["photos"]) == {str(KEYS[1])}
    assert files(run) == [f"corrections/{KEYS[1]}.txt"]


BROKEN_BOXES = [
    [box(x0=float("nan"))], [box(x1=float("inf"))], [box(x0=-1)], [box(x1=WIDTH + 1)], [box(y1=HEIGHT + 0.1)],
    [box(x0=40, x1=10)], [box(y0=60)], [box(x0=10**400)], [box(x0="10")], [box(x0=None)], [box(x0=True)],
    [box("stone")], [box(kind=["rock"])], [{"kind": "rock"}], [[1, 2, 3, 4]], [None], b"{}", b"null", b"", b"[",
    b"\xff", b"[" * 100_000, [box(), box(x0=-5)],
]  # fmt: skip


def test_invalid_boxes_are_refused_without_a_change(run):
    with correcting(run) as running:
        assert change(running, boxes=[box()])[0].status == 200
        before = (run.folder / f"corrections/{SEED}.txt").read_text()
        for boxes in BROKEN_BOXES:
            answer, content = change(running, boxes=boxes)
            assert answer.status == 422, boxes
            assert content.decode().count("\n") == 1
        assert change(running, boxes=b" " * (MAX_REQUEST_BYTES + 1))[0].status == 413
        assert change(running, boxes=[], Content_Length=None)[0].status == 411
    assert (run.folder / f"corrections/{SEED}.txt").read_text() == before
    assert files(run) == [f"corrections/{SEED}.txt"]


UNKNOWN = ("03_B_off_30_L_0256", "09_A_off_30_L_0256", "../seeds/x", "..%2f..%2fx", "", "x.txt", f"{SEED}.txt", "%00")
FOREIGN = [
    (403, {"X_Polarsim_Token": None}),
    (403, {"X_Polarsim_Token": ""}),
    (403, {"X_Polarsim_Token": "guess"}),
    (403, {"X_Polarsim_Token": "\xe4"}),
    (403, {"Origin": "http://evil.example"}),
    (403, {"Origin": "null"}),
    (403, {"Origin": f"http://{HOST}:1"}),
    (403, {"Origin": f"https://{HOST}"}),
    (403, {"Sec_Fetch_Site": "cross-site"}),
    (403, {"Sec_Fetch_Site": "same-site"}),
    (415, {"Content_Type": "text/plain"}),
    (415, {"Content_Type": "application/x-www-form-urlencoded"}),
    (415, {"Content_Type": None}),
    (421, {"host": "evil.example:80"}),
]


def test_unknown_photos_and_requests_of_other_pages_are_refused(run):
    with correcting(run) as running:
        for key in UNKNOWN:
            for method in ("PUT", "DELETE"):
                assert change(running, key, method, b" " * MAX_REQUEST_BYTES)[0].status == 404, key
        for status, headers in FOREIGN:
            assert change(running, boxes=[box()], **headers)[0].status == status, headers
            if status != 415:
                assert change(running, method="DELETE", **headers)[0].status == status, headers
        assert asked(running, f"/data/corrections/{SEED}", "POST")[0].status == 501
        assert asked(running, "/index.html", "OPTIONS")[0].status == 501  # preflight request of a foreign page
    assert files(run) == []


def test_the_token_changes_at_each_start(run):
    tokens = set()
    for _ in range(2):
        with correcting(run) as running:
            tokens.add(corrections_of(running)["token"])
    assert len(tokens) == 2
    assert min(map(len, tokens)) >= 32


def test_class_numbers_follow_the_class_list_of_the_folder(run):
    """labelImg writes its own order of classes; `labels.corrections` uses the names."""
    write_text(run.folder / "corrections/classes.txt", "shadow\nboulder\nrock\n")
    with correcting(run) as running:
        change(running, boxes=[box("rock"), box("shadow", 100, 100, 200, 200)])
    found = read_corrections(run.folder / "corrections", polar(), 3)[SEED]
    np.testing.assert_allclose(found.rocks, [[10, 20, 40, 60]], atol=2e-3)
    np.testing.assert_allclose(found.shadows, [[100, 100, 200, 200]], atol=2e-3)
    write_text(run.folder / "corrections/classes.txt", "rock\n")
    with correcting(run) as running:
        assert change(running, boxes=[box("shadow")])[0].status == 422


def test_other_files_in_the_folder_are_kept_and_read(run):
    below = run.folder / f"corrections/Terrain03/{SEED}.txt"
    yolo.write_boxes(below, np.array([0]), np.array([[10.0, 20, 40, 60]]), size=SIZE)
    write_coco(run.folder / "corrections/cvat.json", {KEYS[1]: []}, polar(), polar().images.size)
    with correcting(run) as running:
        assert set(corrections_of(running)["photos"]) == {str(SEED), str(KEYS[1])}
        assert change(running, boxes=[])[0].status == 200
        assert below.read_text() == ""  # no second file of the photo, which would be an error
        assert change(running, KEYS[1], boxes=[box()])[0].status == 422
        assert change(running, KEYS[1], "DELETE")[0].status == 422
    assert set(read_corrections(run.folder / "corrections", polar(), 3)) == {SEED, KEYS[1]}


def test_errors_name_an_invalid_file_in_the_folder(run):
    write_text(run.folder / f"corrections/{SEED}.txt", "0 what\n")
    with correcting(run) as running:
        answer, content = asked(running, "/data/corrections.json")
    assert answer.status == 500
    assert f"{SEED}.txt" in content.decode()


@settings(max_examples=10)
@given(st.lists(st.tuples(st.sampled_from(["rock", "shadow"]), *[st.floats(0, 1)] * 4), max_size=6))
def test_every_box_inside_the_photo_is_read_back(tmp_path_factory, rows):
    folder = tmp_path_factory.mktemp("run")
    run = Run(folder)
    run.__dict__.update(terrains=(3,), pictures={("photo", SEED): folder})
    corners = [
        (kind, min(a, b) * WIDTH, min(c, d) * HEIGHT, max(a, b) * WIDTH, max(c, d) * HEIGHT)
        for kind, a, b, c, d in rows
    ]
    sent = [row for row in corners if min(row[3] - row[1], row[4] - row[2]) >= 0.01]
    Corrections(run).save(str(SEED), [box(*row) for row in sent])
    found = Corrections(run).read()[str(SEED)]
    wanted = sorted(sent, key=lambda row: row[0])
    assert [one["kind"] for one in found] == [kind for kind, *_ in wanted]
    for one, (_, *edges) in zip(found, wanted, strict=True):
        np.testing.assert_allclose([one[edge] for edge in ("x0", "y0", "x1", "y1")], edges, atol=4e-3)


SLOW = """
import cv2, numpy, polarsim.cli, polarsim.explore.site as site
image = numpy.zeros((600, 900), numpy.uint8)
def decoded(path, width):
    for _ in range(15):  # most of the time, a thread is inside a C++ library
        cv2.GaussianBlur(image, (31, 31), 0)
    return b""
site.jpeg = decoded
polarsim.cli.main()
"""


def test_a_change_in_progress_ends_before_the_server(run, monkeypatch):
    """The command ends all threads at Ctrl-C; a temporary file would remain in the folder of corrections."""
    corrections, write = Corrections(run), yolo.write_boxes
    writing, proceed = threading.Event(), threading.Event()

    def slow(*arguments):
        writing.set()
        proceed.wait(10)
        write(*arguments)

    monkeypatch.setattr(yolo, "write_boxes", slow)
    saving = threading.Thread(target=corrections.save, args=(str(SEED), [box()]))
    saving.start()
    assert writing.wait(10)
    ending = threading.Thread(target=corrections.finish)
    ending.start()
    ending.join(0.1)
    assert ending.is_alive()
    proceed.set()
    ending.join(10)
    assert not ending.is_alive()
    assert [len(boxes) for boxes in Corrections(run).read().values()] == [1]


def test_ctrl_c_during_loading_ends_without_a_crash(made):
    """Threads that decode images at interpreter exit would abort the process."""
    call = (sys.executable, "-u", "-c", SLOW, "explore", made.name, "--no-browser", "--results", made.parent)
    # A shell that starts pytest in the background ignores SIGINT, and child processes inherit this.
    started = subprocess.Popen(
        call, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    connections = []
    try:
        port = int(re.search(r":(\d+)/", started.stdout.readline())[1])
        for key in KEYS[:24]:
            connection = socket.create_connection((HOST, port), timeout=10)
            address = f"/data/pictures/hapke/{key}.jpg"
            connection.sendall(f"GET {address} HTTP/1.1\r\nHost: {HOST}:{port}\r\n\r\n".encode())
            connections.append(connection)
        connections.append(socket.create_connection((HOST, port), timeout=10))  # browsers keep an idle connection
        time.sleep(0.2)
        started.send_signal(signal.SIGINT)
        out, err = started.communicate(timeout=60)
    finally:
        started.kill()
        for connection in connections:
            connection.close()
    assert (started.returncode, err) == (0, "")
    assert out.endswith("stopped\n")


def test_an_overlay_is_written_for_corrected_photos_only(run):
    prepare = {"target": "/data/next_run.json", "method": "PUT", "content": b"{}"}
    with correcting(run) as running:
        headers = {
            "X_Polarsim_Token": running.RequestHandlerClass.token,
            "Content_Type": "application/json",
            "Content_Length": "2",
        }
        assert asked(running, **prepare, **headers)[0].status == 422  # no corrections
        assert asked(running, **prepare, **headers | {"X_Polarsim_Token": "guess"})[0].status == 403
        assert asked(running, "/data/next_run.json")[0].status == 404
        assert change(running, boxes=[box()])[0].status == 200
        former = pd.read_parquet(run.folder / "labels/tables/Terrain03.parquet")
        answer, content = asked(running, **prepare, **headers)
    overlay = run.folder / "corrections.yaml"
    assert answer.status == 200
    assert json.loads(content)["command"] == f"polarsim run labels --configfile {overlay}"
    copied = run.folder / "labels/before_corrections/Terrain03.parquet"
    assert pd.read_parquet(copied).equals(former)
    copied.write_bytes(b"")
    Corrections(run).prepare_run()  # without a new correction, the former labels are kept
    assert copied.read_bytes() == b""
    write_text(run.folder / "config.yaml", "labels: {corrections: mine}")
    with pytest.raises(LabelError, match="reads the corrections of mine"):
        Corrections(run).prepare_run()
    for path in (overlay, run.folder / "config.yaml"):
        path.unlink()
    shutil.rmtree(copied.parent)


def test_a_run_has_the_same_port_at_each_start(run):
    ports = set()
    for _ in range(2):
        with server_of_run(run.folder, {}, None, Corrections(run)) as first:
            ports.add(first.server_address[1])
            with server_of_run(run.folder, {}, None, Corrections(run)) as second:
                assert second.server_address[1] not in ports
    assert len(ports) == 1


def test_tables_are_computed_again_after_a_run_of_the_labels():
    version, made = [1], []
    files = {name: lambda name=name: made.append(name) or b"" for name in ("a.arrow", "b.jpg")}
    kept = FileCache(files, version=lambda: version[0])
    for version[0] in (1, 1, 2):
        for name in files:
            kept.read(name)
    assert made == ["a.arrow", "b.jpg", "a.arrow"]
