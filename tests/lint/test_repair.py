import filecmp
import shutil

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.errors import FormatError, PolarsimError
from polarsim.formats import tables, yolo
from polarsim.lint.folders import lint_folder
from polarsim.lint.repair import REPAIR_TABLE, _drop_malformed, write_repaired
from polarsim.lint.rules import RULES
from polarsim.site import polar
from tests.lint.conftest import BOXES, CLASSES, KEY, LABELS, path
from tests.support.polar_photos import SIZE

POLYGONS = "SegmentationLabels/terrain11/labels"


def repaired(root):
    """Return the copy with all repairs, and its `changes.csv`."""
    before = lint_folder(root, set(RULES))
    out = root.with_name("repaired")
    count = write_repaired(root, before.findings, out)
    changes = tables.read_csv(out / REPAIR_TABLE, ["file", "code"])
    assert len(changes) == count == sum(bool(RULES[one.defect].repair) for one in before.findings)
    assert [one for one in lint_folder(out, set(RULES)).findings if RULES[one.defect].repair] == []
    return out, changes


def files_of(folder):
    return {file.relative_to(folder): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


def assert_whole(copy, exposure_ms):
    classes, boxes = yolo.read_boxes(path(copy, exposure_ms), size=SIZE)
    order = np.lexsort((boxes[:, 0], classes))
    np.testing.assert_array_equal(classes[order], CLASSES)
    np.testing.assert_allclose(boxes[order], BOXES, atol=0.06)


def test_a_sound_tree_is_copied_byte_by_byte(root):
    out, changes = repaired(root)
    assert len(changes) == 0
    compared = filecmp.dircmp(root, out)
    assert compared.right_only == [REPAIR_TABLE]
    assert compared.subdirs["Labels"].subdirs["Terrain11"].diff_files == []


@pytest.mark.parametrize(
    ("classes", "boxes"),
    [
        (CLASSES[1:], BOXES[1:]),  # a missing rock
        (CLASSES[:-1], BOXES[:-1]),  # a missing shadow
        (CLASSES[:3], BOXES[:3]),  # no shadows
        (np.append(CLASSES, 0), np.vstack([BOXES, [30, 30, 70, 70]])),  # an additional rock
        (CLASSES, BOXES + np.array([9, 0, 9, 0])),  # everything moved
        (np.append(CLASSES, 1), np.vstack([BOXES, BOXES[-1:]])),  # a repeated shadow
        (CLASSES[:0], BOXES[:0]),
    ],
)
def test_an_exposure_gets_the_content_of_the_majority(root, classes, boxes):
    yolo.write_boxes(path(root, 1024), classes, boxes, size=SIZE)
    out, changes = repaired(root)
    assert len(changes) >= 1
    assert_whole(out, 1024)


def test_a_missing_file_is_written(root):
    path(root, 512).unlink()
    path(root, 32).unlink()
    out, _ = repaired(root)
    assert_whole(out, 512)
    assert (yolo.read_boxes(path(out, 32), size=SIZE)[0] == 0).all()  # too dark for shadows


def test_malformed_lines_and_boxes_outside_the_photo_are_removed(root):
    text = path(root, 1024).read_text()
    path(root, 1024).write_text("0 0.5 0.5 0.1\n" + text + "rock 1 2 3 4\n")
    out, _ = repaired(root)
    assert path(out, 1024).read_text() == text
    lines = tables.read_csv(out / REPAIR_TABLE, ["line", "code"]).query("code == 'F110'")["line"]
    assert list(lines) == [1, len(text.splitlines()) + 2]


@pytest.mark.parametrize("told", ["4: something of 17 at 2:1", "none of this file, 1: 0", ""])
def test_repairs_do_not_depend_on_the_wording_of_messages(root, monkeypatch, told):
    text = path(root, 1024).read_text()
    path(root, 1024).write_text("0 0.5 0.5 0.1\n" + text + "rock 1 2 3 4\n")
    polygons = root / POLYGONS / path(root, 1024).name
    polygons.parent.mkdir(parents=True)
    sound = "1 0.1 0.1 0.2 0.1 0.2 0.2\n"
    polygons.write_text(sound + "2 0.1 0.1\n" + sound)
    before, _ = repaired(root)
    monkeypatch.setattr(PolarsimError, "__str__", lambda error: told)
    report, after = lint_folder(root, set(RULES)), root.with_name("reworded")
    assert [one.line for one in report.findings if one.defect == "malformed"] == [1, len(text.splitlines()) + 2, 2]
    write_repaired(root, report.findings, after)
    assert path(after, 1024).read_text() == text
    assert files_of(after) == files_of(before)


def test_an_error_at_a_line_that_does_not_exist_is_raised(tmp_path):
    def reader(path):
        raise FormatError("no box", path, 9)

    file = tmp_path / "labels.txt"
    file.write_text("0 0.5 0.5 0.1 0.1\n")
    with pytest.raises(FormatError, match="no box"):
        _drop_malformed(file, reader)
    assert file.read_text() == "0 0.5 0.5 0.1 0.1\n"


def test_files_with_wrong_names_are_removed_and_impossible_exposures_renamed(root):
    text = path(root, 1024).read_text()
    path(root, 1024).rename(path(root, 1024).with_name("11_A_off_30_L_1028.txt"))
    path(root, 256).with_name("11_A_off_30_L_0256 copy.txt").write_text(text)
    path(root, 256).with_name(".DS_Store").write_bytes(b"\0")
    path(root, 256).with_name("01_A_off_30_L_0256.txt").write_text(text)
    out, changes = repaired(root)
    assert sorted(changes["code"]) == ["F101", "F102", "F103", "F104", "F105"]
    assert sorted(one.name for one in (out / LABELS).iterdir()) == sorted(
        f"{KEY.with_exposure(exposure_ms)}.txt" for exposure_ms in polar().exposures_of(11, "30")
    )


def test_polygons_become_valid_and_are_painted_in_order(root):
    ground = np.array([[0, 0], [1936, 0], [1936, 1216], [0, 1216]], float)
    crossing = np.array([[100, 100], [160, 160], [160, 100], [100, 130]], float)
    crumb = np.array([[300, 300], [302, 300], [302, 303], [300, 303]], float)
    (root / POLYGONS).mkdir(parents=True)
    target = root / POLYGONS / f"{KEY}.txt"
    yolo.write_polygons(target, [(2, crossing), (3, crumb), (1, ground)], size=SIZE)
    out, _ = repaired(root)
    kinds = [kind for kind, _ in yolo.read_polygons(out / POLYGONS / target.name, size=SIZE)]
    assert kinds == [1, 2]


def test_an_existing_or_nested_output_folder_is_refused(root):
    for out in (root, root / "inside"):
        with pytest.raises(FormatError, match=str(root)):
            write_repaired(root, [], out)


def twice(lines, row):
    return [*lines, lines[row]]


def nearly_twice(lines, row):
    kind, x, y, *size = lines[row].split()
    return [f"{kind} {float(x) + 0.003:.6f} {y} {' '.join(size)}", *lines]


def cut_short(lines, row):
    return [*lines[:row], lines[row].rpartition(" ")[0], *lines[row + 1 :]]


def with_garbage(lines, row):
    return [*lines[:row], "rock 1 2", *lines[row:]]


EXPOSURES = polar().exposures_of(11, "30")
DEFECTS = [twice, nearly_twice, cut_short, with_garbage]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("defects")


@settings(max_examples=15)
@given(
    data=st.data(),
    damaged=st.dictionaries(
        st.sampled_from(EXPOSURES), st.tuples(st.sampled_from(DEFECTS), st.integers(0, 2)), max_size=len(EXPOSURES) - 1
    ),
)
def test_a_defect_of_any_number_of_exposures_does_not_spread(folder, data, damaged):
    shutil.rmtree(folder, ignore_errors=True)  # an aborted example may have removed the folder
    sound = {exposure_ms: 0 for exposure_ms in EXPOSURES if exposure_ms not in damaged}
    for exposure_ms in data.draw(st.permutations(EXPOSURES)):
        shown = (2 if exposure_ms >= 128 else 1) > CLASSES
        file = path(folder / "tree", exposure_ms)
        yolo.write_boxes(file, CLASSES[shown], BOXES[shown], size=SIZE)
        if exposure_ms in sound:
            sound[exposure_ms] = file.read_bytes()
        else:
            damage, row = damaged[exposure_ms]
            file.write_text("".join(f"{line}\n" for line in damage(file.read_text().splitlines(), row)))
    out, again = folder / "repaired", folder / "again"
    write_repaired(folder / "tree", lint_folder(folder / "tree", set(RULES)).findings, out)
    assert {exposure_ms: path(out, exposure_ms).read_bytes() for exposure_ms in sound} == sound
    shadows = any(exposure_ms >= 128 for exposure_ms in sound)
    for exposure_ms in damaged:
        assert_boxes(path(out, exposure_ms), (2 if exposure_ms >= 128 and shadows else 1) > CLASSES)
    report = lint_folder(out, set(RULES))
    assert [one for one in report.findings if RULES[one.defect].repair] == []
    (out / REPAIR_TABLE).unlink()
    assert write_repaired(out, report.findings, again) == 0
    (again / REPAIR_TABLE).unlink()
    assert files_of(again) == files_of(out)


def assert_boxes(file, shown):
    """Assert the sound boxes of a file, except doubtful shadows that no sound file has."""
    classes, boxes = yolo.read_boxes(file, size=SIZE)
    for number in range(1 + shown.all()):
        mine, wanted = boxes[classes == number], BOXES[number == CLASSES]
        np.testing.assert_allclose(mine[np.argsort(mine[:, 0])], wanted, atol=2e-3)


def test_a_defect_revealed_by_a_repair_is_repaired_and_listed(root):
    file = path(root, 1024)
    lines = file.read_text().splitlines()
    file.write_text("\n".join([lines[0], *lines, "rock 1"]))
    out = root.with_name("repaired")
    write_repaired(root, lint_folder(root, set(RULES)).findings, out)
    assert_whole(out, 1024)
    assert list(tables.read_csv(out / REPAIR_TABLE, ["file", "code"])["code"]) == ["B201", "F110"]
