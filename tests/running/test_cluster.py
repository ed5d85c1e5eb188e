"""SLURM jobs of a killed run, with substitutes of `squeue` and `scancel` that use a file."""

import pytest

from polarsim.errors import PolarsimError
from polarsim.running import cluster

SUBMITTED = """\
Job 12 has been submitted with SLURM jobid 6 (log: /a/logs/slurm/rule_merge_labels/small/6.log).
Submitted group job a0a48c09 with external jobid '7'.
Job 14 has been submitted with SLURM jobid 10 (log: /a/logs/slurm/rule_merge_photos/small/10.log).
"""
SQUEUE = "#!/bin/sh\ncat {queue}\n"
SCANCEL = '#!/bin/sh\nfor number in "$@"; do sed -i "/^$number /d" {queue}; done\n'


@pytest.fixture
def queue(tmp_path, monkeypatch):
    """Queue of SLURM: two jobs in the log of the folder, a job of another user, a job of another folder."""
    (tmp_path / ".snakemake/log").mkdir(parents=True)
    (tmp_path / ".snakemake/log/1.snakemake.log").write_text(SUBMITTED)
    queue, programs = tmp_path / "queue", tmp_path / "bin"
    queue.write_text(f"6 {tmp_path}\n7 {tmp_path}\n8 {tmp_path}\n10 {tmp_path}/other\n")
    programs.mkdir()
    for name, text in (("squeue", SQUEUE), ("scancel", SCANCEL)):
        (programs / name).write_text(text.format(queue=queue))
        (programs / name).chmod(0o755)
    monkeypatch.setenv("PATH", str(programs), prepend=":")
    return queue


def test_what_a_run_submitted_is_cancelled_and_nothing_else(tmp_path, queue):
    assert cluster.end_submitted(tmp_path) == 2
    assert queue.read_text() == f"8 {tmp_path}\n10 {tmp_path}/other\n"
    assert cluster.end_submitted(tmp_path) == 0


def test_jobs_that_do_not_end_are_named(tmp_path, queue, monkeypatch):
    (tmp_path / "bin/scancel").write_text("#!/bin/sh\n")
    monkeypatch.setattr(cluster, "_GONE_S", 0.0)
    with pytest.raises(PolarsimError, match="6 7"):
        cluster.end_submitted(tmp_path)


def test_without_slurm_nothing_was_submitted(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    assert cluster.submitted_jobs(tmp_path) == []
