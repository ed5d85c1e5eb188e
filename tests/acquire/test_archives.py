import re
import shutil
import stat
import zipfile
from types import SimpleNamespace

import pytest

from polarsim.acquire.archives import unpack
from polarsim.errors import FetchError, FormatError, PolarsimError


def pack(path, files, folder="Terrain11_FreshCrater"):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(f"{folder}/{name}" if folder else name, content)
    return path


@pytest.fixture
def archive(tmp_path, rng):
    files = {"stereo.calibration": b"KEY: 1\n", "PosA_1500_Loff/Sun_30/CamL_7_0256.png": rng.bytes(50_000)}
    return pack(tmp_path / "Terrain11_FreshCrater.zip", files)


def left_over(folder, archive):
    return [path for path in folder.rglob("*") if path != archive]


def test_a_top_folder_with_the_name_of_the_archive_is_removed(tmp_path, archive):
    unpack(archive, tmp_path / "Terrain11_FreshCrater")
    found = sorted(path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file())
    assert found == [
        "Terrain11_FreshCrater.zip",
        "Terrain11_FreshCrater/PosA_1500_Loff/Sun_30/CamL_7_0256.png",
        "Terrain11_FreshCrater/stereo.calibration",
    ]


@pytest.mark.parametrize("entry", ["a\\PosA\\x.txt", "export\\a\\PosA\\x.txt", "a/PosA\\x.txt"])
def test_backslashes_of_windows_separate_folders(tmp_path, entry):
    archive = pack(tmp_path / "a.zip", {entry: b"x", "a\\": b""} if entry.startswith("a") else {entry: b"x"}, "")
    unpack(archive, tmp_path / "a", layout=re.compile("PosA"))
    assert [path.relative_to(tmp_path / "a").as_posix() for path in (tmp_path / "a").rglob("*.txt")] == ["PosA/x.txt"]


def test_folders_above_the_layout_are_removed(tmp_path):
    archive = pack(tmp_path / "a.zip", {"PosA/x.txt": b"x"}, folder="my data/export")
    with zipfile.ZipFile(archive, "a") as opened:
        opened.writestr("__MACOSX/._my data", b"")
    unpack(archive, tmp_path / "a", layout=re.compile("PosA"))
    assert (tmp_path / "a/PosA/x.txt").read_bytes() == b"x"


@pytest.mark.parametrize(("method", "flag", "reason"), [(9, 0, "Deflate64"), (97, 0, "method 97"), (8, 1, "encrypted")])
def test_entries_with_unsupported_compression_are_errors_with_a_remedy(tmp_path, archive, method, flag, reason):
    """Compression by Windows above 2 GB: method and flags are in the header of the entry and in the directory."""
    content = bytearray(archive.read_bytes())
    for start, at in ((b"PK\3\4", 6), (b"PK\1\2", 8)):
        for found in re.finditer(re.escape(start), bytes(content)):
            content[found.start() + at] |= flag
            content[found.start() + at + 2] = method
    archive.write_bytes(bytes(content))
    with pytest.raises(FormatError, match=reason):
        unpack(archive, tmp_path / "Terrain11_FreshCrater")
    assert not left_over(tmp_path, archive)


def test_a_folder_with_a_file_of_the_same_name_is_kept(tmp_path):
    unpack(pack(tmp_path / "a.zip", {"a/x.txt": b"x", "y.txt": b"y"}, folder="a"), tmp_path / "a")
    assert (tmp_path / "a/a/x.txt").read_bytes() == b"x"
    assert (tmp_path / "a/y.txt").read_bytes() == b"y"


OUTSIDE = ["../evil.txt", "a/../../evil.txt", "/evil.txt", "C:\\evil.txt", "C:/evil.txt", "a\\..\\..\\evil.txt", "a/.."]


@pytest.mark.parametrize(
    ("files", "named"),
    [
        *(({"good.txt": b"x", name: b"evil"}, "a.zip") for name in OUTSIDE),
        ({"x": b"file", "x/y": b"in it"}, ""),  # a file in place of a folder
        ({f"a/{number}": bytes(1_000_000) for number in range(5)}, "a.zip"),  # a bomb: deflate packs zeros 1,000 to 1
    ],
    ids=[*OUTSIDE, "file and folder", "bomb"],
)
def test_a_harmful_archive_is_a_one_line_error_before_any_output(tmp_path, files, named):
    archive = pack(tmp_path / "a.zip", files, "")
    with pytest.raises(PolarsimError) as caught:
        unpack(archive, tmp_path / "a")
    assert named in str(caught.value)
    assert "\n" not in str(caught.value)
    assert left_over(tmp_path, archive) == []


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_links_and_repeated_entries_are_errors(tmp_path):
    link = zipfile.ZipInfo("link")
    link.external_attr = (stat.S_IFLNK | 0o777) << 16
    for entries in ([(link, "/etc/passwd")], [("x.txt", "1"), ("x.txt", "2")]):
        with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
            for name, content in entries:
                archive.writestr(name, content)
        with pytest.raises(FormatError, match=r"a\.zip: .*'(link|x\.txt)'"):
            unpack(tmp_path / "a.zip", tmp_path / "a")


def test_a_wrong_size_is_an_error(tmp_path, rng):
    archive = pack(tmp_path / "a.zip", {"x": rng.bytes(3000)})
    content = archive.read_bytes()
    assert content.count((3000).to_bytes(4, "little")) >= 2
    archive.write_bytes(content.replace((3000).to_bytes(4, "little"), (2000).to_bytes(4, "little")))
    with pytest.raises(FormatError, match=r"a\.zip: "):
        unpack(archive, tmp_path / "a")
    assert left_over(tmp_path, archive) == []


@pytest.mark.parametrize(
    "damage",
    [
        lambda content: content[:-2000],
        lambda content: content[:20_000] + b"?" + content[20_001:],
        lambda _: b"no zip",
        None,
    ],
    ids=["truncated", "changed", "text", "missing"],
)
def test_a_damaged_or_missing_archive_is_a_one_line_error_without_output(tmp_path, archive, damage):
    content = archive.read_bytes()
    archive.unlink()
    if damage:
        archive.write_bytes(damage(content))
    with pytest.raises(FormatError, match=r"Terrain11_FreshCrater\.zip") as caught:
        unpack(archive, tmp_path / "out")
    assert "\n" not in str(caught.value)
    assert left_over(tmp_path, archive) == []


def test_a_full_disk_is_an_error_before_unpacking(tmp_path, archive, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda path: SimpleNamespace(free=1000))
    with pytest.raises(FetchError, match=r"Terrain11_FreshCrater\.zip"):
        unpack(archive, tmp_path / "out")


def test_an_interruption_leaves_no_partial_output(tmp_path, archive, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(shutil, "copyfileobj", interrupt)
        with pytest.raises(KeyboardInterrupt):
            unpack(archive, tmp_path / "out")
    assert left_over(tmp_path, archive) == []
    unpack(archive, tmp_path / "out")
    assert (tmp_path / "out/Terrain11_FreshCrater/stereo.calibration").exists()
