"""Jobs in a log of Snakemake 9: single jobs and groups of a cluster submission."""

import pytest

from polarsim.running.jobs import LOGS, WorkflowJob, first_log, logs_in, read_jobs

ALONE = """\
[Wed Nov 25 22:30:24 2026]
localrule first:
    output: results/toy/first/Terrain01
    log: results/toy/logs/first_01.log
    jobid: 3
    wildcards: terrain=01
    resources: tmpdir=/tmp
"""
ALONE_FAILED = """\
[Wed Nov 25 22:30:30 2026]
Error in rule first:
    message: None
    jobid: 3
    output: results/toy/first/Terrain01
    log: results/toy/logs/first_01.log (check log file(s) for error details)
"""
GROUP = """\
[Wed Nov 25 22:30:24 2026] Group job terrain (jobs in lexicogr. order):

    [Wed Nov 25 22:30:24 2026]
    rule first:
        output: results/toy/first/Terrain01
        log: results/toy/logs/first_01.log
        jobid: 3
        wildcards: terrain=01
        resources: tmpdir=<TBD>
Shell command: None

    [Wed Nov 25 22:30:24 2026]
    rule second:
        input: results/toy/first/Terrain01
        output: results/toy/second/Terrain01.txt
        log: results/toy/logs/second_01.log
        jobid: 2
        wildcards: terrain=01
        resources: tmpdir=<TBD>
Shell command: None
"""
GROUP_FAILED = """\
[Wed Nov 25 22:31:30 2026]
    message: Error in group terrain
    log: /tmp/logs/slurm/group_terrain_first_second/7.log (check log file(s) for error details)
    jobs:
        rule first:
            jobid: 3
            output: results/toy/first/Terrain01
            log: results/toy/logs/first_01.log (check log file(s) for error details)
        rule second:
            jobid: 2
            output: results/toy/second/Terrain01.txt
            log: results/toy/logs/second_01.log (check log file(s) for error details)
    [Wed Nov 25 22:31:30 2026]
    Error in rule second:
        message: None
        jobid: 2
        input: results/toy/first/Terrain01
        output: results/toy/second/Terrain01.txt
        log: results/toy/logs/second_01.log (check log file(s) for error details)
"""
FINISHED = "[Wed Nov 25 22:32:00 2026]\nFinished jobid: {} (Rule: of any name)\n"
FIRST = WorkflowJob("first", 3, ("results/toy/first/Terrain01",), "results/toy/logs/first_01.log", "terrain=01")
SECOND = WorkflowJob("second", 2, ("results/toy/second/Terrain01.txt",), "results/toy/logs/second_01.log", "terrain=01")


@pytest.mark.parametrize(("log", "jobs"), [(ALONE, [FIRST]), (GROUP, [FIRST, SECOND])], ids=["alone", "group"])
@pytest.mark.parametrize("failed", [False, True])
@pytest.mark.parametrize("finished", [False, True])
def test_each_job_is_started_and_then_failed_or_finished(log, jobs, failed, finished):
    text = log + (GROUP_FAILED if len(jobs) > 1 else ALONE_FAILED) * failed
    text += "".join(FINISHED.format(job.number) for job in jobs) * finished
    found = read_jobs(text.splitlines())
    expected = [vars(job) | {"failed": failed and not finished, "finished": finished} for job in jobs]
    assert [vars(job) for job in found] == expected


def test_the_log_of_a_run_is_the_first_new_one_not_those_of_later_calls_in_the_folder(tmp_path):
    logs = tmp_path / LOGS
    logs.mkdir(parents=True)
    names = [f"2026-11-2{day}T120000.000000.snakemake.log" for day in range(3)]
    (logs / names[0]).touch()
    before = logs_in(tmp_path)
    assert first_log(tmp_path, before) == []
    for name in names[1:]:
        (logs / name).touch()
        assert first_log(tmp_path, before) == [names[1]]
