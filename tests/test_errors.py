import logging
import pickle
import subprocess
import sys
from pathlib import Path

import pytest

from polarsim import errors
from polarsim.errors import DetectError, FormatError, LabelError, PolarsimError, with_part, with_path
from polarsim.formats import tables, yolo
from polarsim.reporting import USAGE_PATTERN, reporting
from polarsim.rover.drive.energy import EnergyError
from polarsim.rover.drive.state import OffGridError
from tests.support.polar_photos import SIZE

KINDS = [kind for kind in vars(errors).values() if isinstance(kind, type) and issubclass(kind, PolarsimError)]


@pytest.mark.parametrize("kind", [*KINDS, EnergyError, OffGridError])
def test_a_pickled_error_keeps_its_fields(kind):
    with pytest.raises(kind) as caught, with_path("labels.txt"), with_part("image 2"):
        raise kind("5 fields", line=3)
    copy = pickle.loads(pickle.dumps(caught.value))
    assert type(copy) is kind
    assert (copy.reason, copy.path, copy.line) == ("image 2: 5 fields", Path("labels.txt"), 3)
    assert str(copy) == "labels.txt:3: image 2: 5 fields"


def test_a_file_that_is_known_is_not_hidden():
    with pytest.raises(LabelError) as caught, with_path("folder"), with_path("inner.txt"):
        raise LabelError("no key", "file.txt", 4)
    assert str(caught.value) == "file.txt:4: no key"


def test_people_read_position_and_reason(tmp_path):
    path = tmp_path / "01_A_off_180_L_0256.txt"
    path.write_text("0 0.5 0.5 0.1 0.1\n\n0 0.5 0.5 0.1\n")
    with pytest.raises(FormatError) as caught:
        yolo.read_boxes(path, size=SIZE)
    assert str(caught.value).startswith(f"{path}:3: 4 fields, expected a box of 5")
    table = tmp_path / "split.csv"
    table.write_text("key\n1\n")
    with pytest.raises(FormatError) as caught:
        tables.read_csv(table, ["key", "part"])
    assert str(caught.value) == f"{table}: column 'part' is missing"
    assert str(DetectError("training diverged")) == "training diverged"


@pytest.mark.parametrize(
    ("module", "extra"), [("mujoco", "rover"), ("torch", "detect"), ("mcap_ros2.writer", "publish")]
)
def test_a_script_without_an_extra_ends_in_one_line_that_names_it(tmp_path, capsys, module, extra):
    with pytest.raises(SystemExit) as caught, reporting(tmp_path / "job.log"):
        raise ModuleNotFoundError(f"No module named {module!r}", name=module)
    assert caught.value.code == 2
    assert f"polarsim[{extra}]" in capsys.readouterr().err
    assert f"polarsim[{extra}]" in (tmp_path / "job.log").read_text()
    with pytest.raises(ModuleNotFoundError), reporting():
        raise ModuleNotFoundError("No module named 'polarsim.labels.other'", name="polarsim.labels.other")


def test_the_log_of_a_successful_script_ends_with_its_usage_and_of_no_other(tmp_path):
    with reporting(tmp_path / "job.log"):
        logging.getLogger("polarsim").info("took a photo")
        subprocess.run([sys.executable, "-c", "sum(range(3_000_000))"], check=True)
    text = (tmp_path / "job.log").read_text()
    (usage,) = USAGE_PATTERN.findall(text)
    assert text.splitlines()[-1].endswith(" MB")
    seconds, cpu_s, peak_mb = map(float, usage)
    assert seconds > 0
    assert cpu_s > 0.02  # with the child process
    assert peak_mb > 10
    with pytest.raises(SystemExit), reporting(tmp_path / "job.log"):
        raise DetectError("training diverged")
    assert not USAGE_PATTERN.search((tmp_path / "job.log").read_text())
