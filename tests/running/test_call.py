"""Arguments that `polarsim run` passes to Snakemake."""

from polarsim.running.run import Call

PROFILE = ("--profile", "config/profiles/slurm")


def test_a_profile_says_how_many_cores_how_long_to_wait_for_files_and_how_to_schedule():
    alone, profiled = Call(("labels",), (), ()).words(), Call(("labels",), (), (), rest=PROFILE).words()
    assert set(alone) - set(profiled) == {"--cores", "2", "--latency-wait", "10", "--scheduler", "greedy"}
    assert profiled[-2:] == list(PROFILE)


def test_cores_that_are_asked_for_count_with_a_profile_too():
    words = Call((), (), (), cores=3, rest=("--profile=config/profiles/slurm",)).words()
    assert words[words.index("--cores") + 1] == "3"
