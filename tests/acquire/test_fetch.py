import hashlib
import io
import json
import threading
import time
import urllib.error
import urllib.request
import zipfile
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field
from http.client import HTTPMessage
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from polarsim import download
from polarsim.acquire.fetch import PINS, archives_of, fetch_archive, fetch_terrain
from polarsim.acquire.options import FetchLimits, SourceOptions
from polarsim.errors import ConfigError, FetchError, FormatError
from polarsim.formats import site_files
from polarsim.site import polar as polar_site

NAME = "Terrain11_FreshCrater.zip"
FAST = FetchLimits(tries=3, backoff_s=0, timeout_s=5)
ONCE = FetchLimits(tries=1, backoff_s=0, timeout_s=5)


def fetch_polar(**given):
    fetch_terrain(site=polar_site(), **given)


@dataclass
class Site:
    """A server of files in memory that can be cut, refuse or change."""

    url: str = ""
    files: dict[str, bytes] = field(default_factory=dict)
    cuts: list[int] = field(default_factory=list)  # bytes sent of the next answers before the line breaks
    refusals: list[int] = field(default_factory=list)  # statuses of the next answers
    lies: list[int] = field(default_factory=list)  # bytes that the next answers state in addition to their content
    redirects: dict[str, str] = field(default_factory=dict)  # by name
    pause_s: float = 0.0  # between two bytes
    tagged: bool = True
    requests: list[str] = field(default_factory=list)  # name and range of each

    def answer(self, request: BaseHTTPRequestHandler) -> None:
        name = request.path.removeprefix("http://archive.invalid").lstrip("/")
        self.requests.append(f"{name} {request.headers.get('Range', '')}".strip())
        if self.refusals or name not in {*self.files, *self.redirects}:
            request.send_error(self.refusals.pop(0) if self.refusals else 404)
            return
        if name in self.redirects:
            request.send_response(302)
            request.send_header("Location", self.redirects[name])
            request.end_headers()
            return
        content = self.files[name]
        tag = f'"{hashlib.sha256(content).hexdigest()}"'
        start = 0
        if request.headers.get("If-Range") == tag:
            start = int(request.headers["Range"].removeprefix("bytes=").rstrip("-"))
        if start >= len(content) > 0 and start:
            request.send_response(416)
            request.send_header("Content-Range", f"bytes */{len(content)}")
            request.send_header("Content-Length", "0")
            request.end_headers()
            return
        request.send_response(206 if start else 200)
        request.send_header("Content-Length", str(len(content) - start + (self.lies.pop(0) if self.lies else 0)))
        if start:
            request.send_header("Content-Range", f"bytes {start}-{len(content) - 1}/{len(content)}")
        if self.tagged:
            request.send_header("ETag", tag)
        request.end_headers()
        end = start + self.cuts.pop(0) if self.cuts else len(content)
        for byte in range(start, end) if self.pause_s else ():
            request.wfile.write(content[byte : byte + 1])
            time.sleep(self.pause_s)
        if not self.pause_s:
            request.wfile.write(content[start:end])


@pytest.fixture
def site():
    found = Site()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self):
            with suppress(ConnectionError):  # the client may end the transfer
                found.answer(self)

        def log_message(self, *args):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    found.url = f"http://127.0.0.1:{server.server_port}"
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
    thread.start()
    yield found
    server.shutdown()
    server.server_close()
    thread.join()


def packed(files):
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        for name in sorted(files):
            archive.writestr(zipfile.ZipInfo(name), files[name])
    return content.getvalue()


@pytest.fixture
def content(rng):
    end = packed({})  # zip archives are recognised by the end of the file
    return rng.bytes(3_000_000 - len(end)) + end


def fetch(site, root, options=FAST, name=NAME):
    return fetch_archive(name=name, url=f"{site.url}/{name}", root=root, limits=options)


def names(root):
    return sorted(path.name for path in root.iterdir())


def test_an_archive_is_fetched_and_its_checksum_pinned(site, tmp_path, content):
    site.files[NAME] = content
    path = fetch(site, tmp_path / "data")
    assert path.read_bytes() == content
    assert json.loads((tmp_path / "data" / PINS).read_text()) == {NAME: hashlib.sha256(content).hexdigest()}
    assert names(tmp_path / "data") == [NAME, PINS]


def test_an_interrupted_download_resumes(site, tmp_path, content):
    site.files[NAME], site.cuts = content, [2_000_000, 300_000]
    assert fetch(site, tmp_path).read_bytes() == content
    assert site.requests == [NAME, f"{NAME} bytes=2000000-", f"{NAME} bytes=2300000-"]


def test_a_later_run_resumes_the_download(site, tmp_path, content):
    site.files[NAME], site.cuts = content, [2_000_000]
    with pytest.raises(FetchError, match="2000000 of 3000000"):
        fetch(site, tmp_path, ONCE)
    assert not (tmp_path / NAME).exists()
    assert fetch(site, tmp_path, ONCE).read_bytes() == content
    assert site.requests[-1] == f"{NAME} bytes=2000000-"
    assert names(tmp_path) == [NAME, PINS]


def test_a_complete_download_that_was_not_renamed_is_used(site, tmp_path, content):
    site.files[NAME] = content
    fetch(site, tmp_path)
    (tmp_path / NAME).rename(tmp_path / f".{NAME}.part")
    (tmp_path / f".{NAME}.version").write_text(f'"{hashlib.sha256(content).hexdigest()}"')
    assert fetch(site, tmp_path, ONCE).read_bytes() == content
    assert site.requests[-1] == f"{NAME} bytes=3000000-"


def test_a_cut_at_any_byte_loses_nothing(site, tmp_path):
    site.files[NAME] = whole = packed({})
    for cut in range(len(whole) + 1):
        site.cuts = [cut, *([1] if cut < len(whole) - 1 else [])]
        root = tmp_path / str(cut)
        assert fetch(site, root).read_bytes() == whole
        assert names(root) == [NAME, PINS]


def test_a_wrong_stated_length_never_gives_a_wrong_file(site, tmp_path, content):
    site.files[NAME], site.lies = content, [1000, -1000, 10**16]
    assert fetch(site, tmp_path / "longer").read_bytes() == content
    for root, reason in ((tmp_path / "shorter", "zip"), (tmp_path / "huge", "10000000003 MB")):  # above the free space
        root.mkdir()
        pin(root, content)
        with pytest.raises(FetchError, match=reason):
            fetch(site, root)
        assert not (root / NAME).exists()


@pytest.mark.parametrize("pause_s", [0.02, 1.0], ids=["slow", "silent"])
def test_a_slow_or_silent_server_is_an_error(site, tmp_path, content, pause_s):
    site.files[NAME], site.pause_s = content, pause_s
    with pytest.raises(FetchError, match=NAME):
        fetch(site, tmp_path, FetchLimits(tries=1, backoff_s=0, timeout_s=0.2))


def test_a_redirect_is_followed(site, tmp_path, content):
    site.files["moved"], site.redirects[NAME] = content, f"{site.url}/moved"
    assert fetch(site, tmp_path).read_bytes() == content


@pytest.mark.parametrize("to", ["file:///etc/passwd", "ftp://127.0.0.1/x.zip", "gopher://x", f"/{NAME}"])
def test_a_circular_redirect_or_one_to_another_protocol_is_an_error(site, tmp_path, to):
    site.redirects[NAME] = to
    with pytest.raises(FetchError, match="302"):
        fetch(site, tmp_path)
    assert len(site.requests) < 20


def test_a_redirect_from_https_to_http_is_an_error():
    request = urllib.request.Request("https://archive.invalid/a.zip")
    with pytest.raises(urllib.error.HTTPError, match=r"redirects to http://archive\.invalid/a\.zip"):
        download._Redirects().redirect_request(
            request, io.BytesIO(), 302, "", HTTPMessage(), "http://archive.invalid/a.zip"
        )


def test_a_page_instead_of_an_archive_is_an_error_and_not_pinned(site, tmp_path):
    site.files[NAME] = b"<html>please accept our terms</html>"
    with pytest.raises(FetchError, match=NAME):
        fetch(site, tmp_path)
    assert names(tmp_path) == []


def test_a_proxy_is_used(site, tmp_path, content, monkeypatch):
    site.files[NAME] = content
    monkeypatch.setenv("http_proxy", site.url)
    monkeypatch.setenv("no_proxy", "")
    path = fetch_archive(name=NAME, url=f"http://archive.invalid/{NAME}", root=tmp_path, limits=ONCE)
    assert path.read_bytes() == content


def pin(root, content):
    (root / PINS).write_text(json.dumps({NAME: hashlib.sha256(content).hexdigest()}))


def test_a_file_that_changed_on_the_server_is_downloaded_again(site, tmp_path, content):
    site.files[NAME], site.cuts = content, [2_000_000]
    with pytest.raises(FetchError):
        fetch(site, tmp_path, ONCE)
    site.files[NAME] = content[1:]
    assert fetch(site, tmp_path, ONCE).read_bytes() == content[1:]


def test_without_an_etag_an_interrupted_download_restarts(site, tmp_path, content):
    site.files[NAME], site.cuts, site.tagged = content, [2_000_000], False
    assert fetch(site, tmp_path).read_bytes() == content
    assert site.requests == [NAME, NAME]


def test_a_checksum_that_differs_from_the_pinned_checksum_is_an_error(site, tmp_path, content):
    site.files[NAME] = content
    (tmp_path / PINS).write_text(json.dumps({NAME: "0" * 64}))
    with pytest.raises(FetchError, match=rf"{NAME}: .*{PINS}"):
        fetch(site, tmp_path)
    assert names(tmp_path) == [PINS]


def test_an_existing_archive_is_used_and_pinned_and_verified(site, tmp_path):
    (tmp_path / NAME).write_bytes(b"local")
    assert fetch(site, tmp_path).read_bytes() == b"local"
    assert site.requests == []
    (tmp_path / NAME).write_bytes(b"changed")
    with pytest.raises(FetchError, match=PINS):
        fetch(site, tmp_path)


def test_a_missing_file_is_an_error_with_address_and_reason(site, tmp_path):
    with pytest.raises(FetchError, match=rf"^{site.url}/{NAME}: .*404") as caught:
        fetch(site, tmp_path)
    assert "\n" not in str(caught.value)
    assert site.requests == [NAME]
    assert names(tmp_path) == []


def test_a_busy_server_is_tried_again(site, tmp_path, content):
    site.files[NAME], site.refusals = content, [503, 503]
    assert fetch(site, tmp_path / "busy").read_bytes() == content
    assert len(site.requests) == 3
    site.refusals = [503] * 9
    with pytest.raises(FetchError, match="503"):
        fetch(site, tmp_path / "always busy")
    assert len(site.requests) == 6


def test_a_missing_server_is_a_one_line_error(tmp_path):
    with pytest.raises(FetchError, match=r"http://127\.0\.0\.1:9/a\.zip") as caught:
        fetch_archive(name="a.zip", url="http://127.0.0.1:9/a.zip", root=tmp_path, limits=FAST)
    assert "\n" not in str(caught.value)


def test_a_missing_archive_without_address_is_an_error(tmp_path):
    with pytest.raises(FetchError, match=NAME):
        fetch_archive(name=NAME, url=None, root=tmp_path, limits=FAST)


@pytest.mark.parametrize("pins", ["[]", "{", '{"a.zip": 1}'])
def test_an_invalid_list_of_checksums_is_a_one_line_error(tmp_path, pins):
    (tmp_path / NAME).write_bytes(b"local")
    (tmp_path / PINS).write_text(pins)
    with pytest.raises(FormatError, match=PINS):
        fetch_archive(name=NAME, url=None, root=tmp_path, limits=FAST)


NASA = {
    "Terrain11_FreshCrater/stereo.calibration": "KEY: 1\n",
    "Terrain11_FreshCrater/PosA_1500_Loff/Sun_30/CamL_7_0256.png": "png",
}
RANGES = "GroundTruth_RectifiedRangeMaps.zip"


@pytest.fixture
def polar(site, tmp_path):
    site.files[NAME] = packed(NASA)
    site.files[RANGES] = packed({"GroundTruth_RectifiedRangeMaps/Terrain11/PosA_org-XYZ.tif": "tif"})
    site.files["Terrain03_MeanDistr.zip"] = packed({"Terrain03_MeanDistr/stereo.calibration": "KEY: 1\n"})
    urls = {name: f"{site.url}/{name}" for name in site.files}
    return SourceOptions(kind="files", root=tmp_path / "polar", urls=urls)


def test_archives_of_a_terrain_become_folders_and_a_receipt(site, tmp_path, polar):
    fetch_polar(terrain=11, source=polar, done=tmp_path / "receipt.json")
    receipt = json.loads((tmp_path / "receipt.json").read_text())
    assert receipt["files"] == [
        "GroundTruth_RectifiedRangeMaps/Terrain11/PosA_org-XYZ.tif",
        "Terrain11_FreshCrater/PosA_1500_Loff/Sun_30/CamL_7_0256.png",
        "Terrain11_FreshCrater/stereo.calibration",
    ]
    assert receipt["archives"] == {name: hashlib.sha256(site.files[name]).hexdigest() for name in (NAME, RANGES)}
    assert all((polar.root / name).is_file() for name in receipt["files"])
    assert not any("Terrain03" in request for request in site.requests)


def test_terrains_share_an_archive_and_a_second_fetch_writes_the_same_receipt(site, tmp_path, polar):
    for terrain, receipt in ((3, "03"), (11, "first"), (11, "second")):
        fetch_polar(terrain=terrain, source=polar, done=tmp_path / receipt)
    assert sorted(site.requests) == sorted(site.files)
    assert (tmp_path / "second").read_bytes() == (tmp_path / "first").read_bytes()


def test_jobs_at_the_same_time_fetch_a_shared_archive_once(site, tmp_path, polar):
    with ThreadPoolExecutor(2) as jobs:
        receipts = [
            jobs.submit(
                fetch_terrain, site=polar_site(), terrain=terrain, source=polar, done=tmp_path / f"{terrain}.json"
            )
            for terrain in (3, 11)
        ]
    assert [receipt.result() for receipt in receipts] == [None, None]
    assert site.requests.count(RANGES) == 1
    assert len(json.loads((polar.root / PINS).read_text())) == 3


def test_local_folders_need_no_archive(tmp_path):
    calibration = tmp_path / "Terrain11_FreshCrater" / "stereo.calibration"
    calibration.parent.mkdir()
    calibration.write_text("KEY: 1\n")
    fetch_terrain(
        site=polar_site(), terrain=11, source=SourceOptions(kind="files", root=tmp_path), done=tmp_path / "receipt.json"
    )
    assert json.loads((tmp_path / "receipt.json").read_text())["folders"] == ["Terrain11_FreshCrater"]


@pytest.mark.parametrize(
    ("name", "form"),
    [
        (NAME, "{}"),
        (NAME, "export/{}"),
        (NAME, "my data/2026/{}"),
        (NAME.replace(".zip", ".ZIP"), "{}"),
        ("Terrain11.zip", "download/{}"),
        ("NASA.Zip", "a/b/{}"),
    ],
)
@pytest.mark.parametrize("separator", ["/", "\\"])
def test_zips_of_other_systems_and_with_other_top_folders_give_the_same_photos(tmp_path, name, form, separator):
    files = {form.format(path).replace(".png", ".PNG").replace("/", separator): text for path, text in NASA.items()}
    (tmp_path / name).write_bytes(packed(files))
    fetch_terrain(
        site=polar_site(), terrain=11, source=SourceOptions(kind="files", root=tmp_path), done=tmp_path / "receipt.json"
    )
    assert [str(key) for key, _ in site_files.find_photos(polar_site(), tmp_path, 11)[0]] == ["11_A_off_30_L_0256"]
    assert site_files.find_calibration(polar_site(), tmp_path, 11) is not None


@pytest.mark.parametrize(
    "files",
    [
        {"readme.txt": "text"},
        {"readme.txt": "text", "x/y/z/PosA_1500_Loff/Sun_30/CamL_7_0256.png": "png"},
        {"stereo.calibration": "", "x/y/PosA_1500_Loff/Sun_30/CamL_7_0256.png": "png"},
    ],
)
def test_an_archive_without_content_of_the_layout_is_an_error(tmp_path, files):
    (tmp_path / NAME).write_bytes(packed({f"Terrain11_FreshCrater/{name}": text for name, text in files.items()}))
    with pytest.raises(FetchError, match=r"Terrain11_FreshCrater"):
        fetch_terrain(
            site=polar_site(),
            terrain=11,
            source=SourceOptions(kind="files", root=tmp_path),
            done=tmp_path / "receipt.json",
        )
    assert not (tmp_path / "receipt.json").exists()


def test_a_truncated_archive_is_a_one_line_error_and_can_be_replaced(tmp_path):
    source = SourceOptions(kind="files", root=tmp_path / "polar")
    source.root.mkdir()
    (source.root / NAME).write_bytes(packed(NASA)[:-30])
    with pytest.raises(FormatError, match=NAME):
        fetch_polar(terrain=11, source=source, done=tmp_path / "receipt.json")
    assert not (tmp_path / "receipt.json").exists()
    assert not (source.root / "Terrain11_FreshCrater").exists()


def test_archives_without_the_terrain_are_an_error_with_the_expected_folders(tmp_path, polar):
    with pytest.raises(FetchError, match=r"Terrain05_\*"):
        fetch_polar(terrain=5, source=polar, done=tmp_path / "receipt.json")
    assert not (tmp_path / "receipt.json").exists()


def test_folders_of_a_release_are_moved_to_the_root(site, tmp_path):
    site.files["POLAR-Sim.zip"] = packed(
        {
            "POLAR-Sim-main/Labels/Terrain01/01_A_off_30_L_0256.txt": "0 0.5 0.5 0.1 0.1\n",
            "POLAR-Sim-main/TerrainMeshes/Terrain01/terrain01_rock1.obj": "",
            "POLAR-Sim-main/README.md": "text",
        }
    )
    urls = {"POLAR-Sim.zip": f"{site.url}/POLAR-Sim.zip"}
    source = SourceOptions(kind="release", root=tmp_path / "release", urls=urls)
    fetch_polar(terrain=1, source=source, done=tmp_path / "first.json")
    assert json.loads((tmp_path / "first.json").read_text())["files"] == [
        "Labels/Terrain01/01_A_off_30_L_0256.txt",
        "TerrainMeshes/Terrain01/terrain01_rock1.obj",
    ]
    fetch_polar(terrain=1, source=source, done=tmp_path / "second.json")
    assert len(site.requests) == 1


def test_a_release_that_was_unpacked_in_part_is_completed(tmp_path):
    source = SourceOptions(kind="release", root=tmp_path)
    (tmp_path / "POLAR-Sim.zip").write_bytes(packed({"top/Labels/Terrain01/x.txt": "", "top/README.md": ""}))
    fetch_polar(terrain=1, source=source, done=tmp_path / "receipt.json")
    (tmp_path / "Labels").rename(tmp_path / "POLAR-Sim" / "Labels")  # as after a stop between unpacking and moving
    fetch_polar(terrain=1, source=source, done=tmp_path / "receipt.json")
    assert (tmp_path / "Labels" / "Terrain01" / "x.txt").exists()


def test_the_analog_is_not_fetched(tmp_path):
    with pytest.raises(ConfigError, match=r"source\.kind"):
        fetch_polar(terrain=1, source=SourceOptions(root=tmp_path), done=tmp_path / "receipt.json")


def test_archives_are_assigned_to_terrains_by_name(tmp_path):
    for name in ("Terrain01_LargeOnly.zip", "Terrain11_FreshCrater.zip", "dataset.zip", "Terrain011.zip"):
        (tmp_path / name).write_bytes(b"")
    source = SourceOptions(kind="files", root=tmp_path)
    assert archives_of(polar_site(), 1, source) == ["Terrain011.zip", "Terrain01_LargeOnly.zip", "dataset.zip"]
