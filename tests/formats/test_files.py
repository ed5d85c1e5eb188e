import errno
import json
import shutil
from pathlib import Path

import pytest

from polarsim.errors import ConfigError, FormatError, PolarsimError
from polarsim.formats.files import (
    check_new_folder,
    read_json,
    share_file,
    write_json,
    write_text,
    writing,
    writing_folder,
)


def test_a_file_appears_only_when_it_is_complete(tmp_path):
    target = tmp_path / "deep" / "table.csv"
    with writing(target) as temporary:
        temporary.write_text("whole")
        assert not target.exists()
        assert temporary.suffix == ".csv"  # writers choose the format by it
    assert target.read_text() == "whole"
    assert [path.name for path in target.parent.iterdir()] == ["table.csv"]


@pytest.mark.parametrize("interruption", [ValueError, KeyboardInterrupt])
def test_an_interrupted_write_keeps_only_the_old_file(tmp_path, interruption):
    target = tmp_path / "table.csv"
    target.write_text("old")

    def write_half():
        with writing(target) as temporary:
            temporary.write_text("half")
            raise interruption

    with pytest.raises(interruption):
        write_half()
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_a_full_disk_is_a_one_line_error_with_the_file(tmp_path):
    def write_on_full_disk():
        with writing(tmp_path / "table.csv") as temporary:
            temporary.write_text("half")
            raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(PolarsimError, match=r"table\.csv"):
        write_on_full_disk()
    assert not list(tmp_path.iterdir())


def test_a_file_instead_of_a_folder_is_a_one_line_error(tmp_path):
    (tmp_path / "results").write_text("a file")
    with pytest.raises(PolarsimError, match=r"results/run/table\.csv"):
        write_text(tmp_path / "results" / "run" / "table.csv", "x")


@pytest.mark.parametrize("links", [True, False])
def test_a_shared_file_does_not_change_when_the_source_is_replaced(tmp_path, monkeypatch, links):
    def refused(*_):
        raise OSError(errno.EXDEV, "Invalid cross-device link")

    if not links:
        monkeypatch.setattr("os.link", refused)
    write_text(tmp_path / "source", "one")
    share_file(tmp_path / "source", tmp_path / "target")
    assert (tmp_path / "source").samefile(tmp_path / "target") == links
    write_text(tmp_path / "source", "two")
    assert not (tmp_path / "target").is_symlink()
    assert (tmp_path / "target").read_text() == "one"


@pytest.mark.parametrize("interruption", [ValueError, KeyboardInterrupt])
def test_an_interrupted_write_keeps_the_old_folder(tmp_path, interruption):
    target = tmp_path / "seeds"
    target.mkdir()
    (target / "old.txt").write_text("old")

    def write_half():
        with writing_folder(target) as temporary:
            (temporary / "new.txt").write_text("new")
            raise interruption

    with pytest.raises(interruption):
        write_half()
    assert list(tmp_path.rglob("*.txt")) == [target / "old.txt"]


def test_json_has_sorted_keys_and_reads_back(tmp_path):
    write_json(tmp_path / "a.json", {"b": [1.5, "x"], "a": None})
    assert (tmp_path / "a.json").read_text().index('"a"') < (tmp_path / "a.json").read_text().index('"b"')
    assert read_json(tmp_path / "a.json") == json.loads('{"a": null, "b": [1.5, "x"]}')


@pytest.mark.parametrize("content", [b"{", b"\xff\xfe", b""])
def test_invalid_json_is_a_one_line_error_with_the_file(tmp_path, content):
    (tmp_path / "a.json").write_bytes(content)
    with pytest.raises(FormatError, match=r"a\.json") as caught:
        read_json(tmp_path / "a.json")
    assert "\n" not in str(caught.value)


def test_a_folder_is_renamed_before_it_is_deleted(tmp_path, monkeypatch):
    """A process that is killed during the removal of the former folder leaves the complete new folder."""
    target = tmp_path / "clouds"
    for content in ("old", "new"):
        seen = []
        monkeypatch.setattr(shutil, "rmtree", lambda path, seen=seen, **_: seen.append(Path(path) == target))
        with writing_folder(target) as folder:
            (folder / "a.txt").write_text(content)
        assert not any(seen)
        assert (target / "a.txt").read_text() == content
        monkeypatch.undo()


def test_only_new_or_empty_folders_may_be_written(tmp_path):
    check_new_folder(tmp_path / "new")
    check_new_folder(tmp_path)
    (tmp_path / "file").write_text("")
    for path in (tmp_path, tmp_path / "file"):
        with pytest.raises(ConfigError) as error:
            check_new_folder(path)
        assert error.value.path == path
