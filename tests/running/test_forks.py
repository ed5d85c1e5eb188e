"""Scripts in forks of a server give the same results as scripts in new processes, and end with their clients."""

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest

from polarsim.running import forks

SERVE = """
import atexit, os, sys, weakref
from pathlib import Path
from polarsim.running import forks
owner = os.getppid()
atexit.register(print, "exit function of the server")
weakref.finalize(sys, print, "finalizer of the server")
forks.serve(Path(sys.argv[1]), lambda: sys.modules.update(prepared=sys), lambda: os.getppid() == owner)
"""
STATE = """
import os, sys, tempfile
word = sys.stdin.read()
print(os.getcwd(), sys.argv[1:], os.environ["WORD"], tempfile.gettempdir(), word, sys.path[0], __name__)
print("warning", file=sys.stderr)
sys.exit(int(os.environ["WORD"]))
"""
IS_FORK = "import sys\nprint('prepared' in sys.modules)\n"
SLEEP = """
import os, sys, time
try:
    print(os.getpid(), flush=True)
    time.sleep(60)
except KeyboardInterrupt:
    time.sleep(0.3)  # a second signal would end this
    print("stopped", flush=True)
    sys.exit(130)
"""
SNAKEFILE = """
rule all:
    input: "forked.txt"
rule wait:
    output: "ready.txt"
    shell: "while [ ! -e .snakemake/polarsim_forks ]; do sleep 0.02; done; touch {output}"
rule forked:
    input: "ready.txt"
    output: "forked.txt"
    script: "workflow/scripts/forked.py"
"""
HAS_IMPORTS = """
import sys
is_there = "polarsim.paths" in sys.modules
open(snakemake.output[0], "w").write(str(is_there))
"""
RUN = "import sys; from polarsim.running import forks; forks._LATE = (); sys.exit(forks.run_with_server(sys.argv[1:]))"


def environment(**values: str) -> dict[str, str]:
    return os.environ | {"OMP_NUM_THREADS": "1", **values}


@pytest.fixture(scope="module")
def python() -> Iterator[Path]:
    """The client of a server without other imports."""
    with tempfile.TemporaryDirectory() as folder:
        address, program = Path(folder, "socket"), Path(folder, "python")
        server = subprocess.Popen([sys.executable, "-c", SERVE, str(address)])
        while not address.exists():
            assert server.poll() is None
            time.sleep(0.01)
        assert address.stat().st_mode & 0o777 == 0o600
        forks.write_client(program, address)
        yield program
        server.kill()
        server.wait()


@pytest.fixture
def script(tmp_path: Path) -> Callable[[str], Path]:
    def write(text: str) -> Path:
        path = tmp_path / "folder with \u00fc" / "script.py"
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
        return path

    return write


def lines_of(program: Path | str, *arguments: object, **values: str) -> list[str]:
    call = [str(program), *map(str, arguments)]
    return subprocess.run(call, env=environment(**values), capture_output=True, text=True).stdout.split("\n")


@pytest.mark.parametrize("word", ["0", "3"])
def test_a_script_has_the_folder_arguments_environment_streams_and_exit_code_of_its_client(
    python, script, tmp_path, word
):
    path = script(STATE)
    results = [
        subprocess.run(
            [str(program), str(path), "a b", "--c"], cwd=path.parent, env=environment(WORD=word, TMPDIR=str(tmp_path)),
            capture_output=True, text=True, input="from stdin",
        )
        for program in (python, sys.executable)
    ]  # fmt: skip
    assert results[0].returncode == int(word)
    fork, process = ((result.returncode, result.stdout, result.stderr) for result in results)
    assert fork == process
    assert str(tmp_path) in fork[1]


def test_scripts_at_the_same_time_have_their_own_exit_codes(python, script):
    path = script("import os, sys\nsys.exit(int(os.environ['WORD']))\n")
    clients = [subprocess.Popen([python, path], env=environment(WORD=str(code))) for code in range(40)]
    assert [client.wait(60) for client in clients] == list(range(40))


def test_an_exception_has_its_traceback_and_code_1(python, script):
    done = subprocess.run([python, script("1 / 0")], env=environment(), capture_output=True, text=True)
    assert done.returncode == 1
    assert "ZeroDivisionError" in done.stderr


def test_output_of_libraries_and_functions_at_the_end_are_not_lost(python, script):
    text = (
        "import atexit, ctypes, sys, weakref\natexit.register(print, 'last')\n"
        "weakref.finalize(sys, print, 'finalized')\nctypes.CDLL(None).puts(b'of C')\n"
    )
    assert sorted(lines_of(python, script(text))) == ["", "finalized", "last", "of C"]


@pytest.mark.parametrize(("threads", "is_fork"), [("1", "True"), ("2", "False")])
def test_only_jobs_with_one_thread_are_forks(python, script, threads, is_fork):
    assert lines_of(python, script(IS_FORK), OMP_NUM_THREADS=threads)[0] == is_fork


def test_other_programs_and_jobs_without_a_server_use_the_interpreter(python, script, tmp_path):
    assert lines_of(python, "-c", IS_FORK)[0] == "False"
    forks.write_client(tmp_path / "alone", tmp_path / "no socket")
    assert lines_of(tmp_path / "alone", script(IS_FORK))[0] == "False"


def default_signals() -> None:
    """Do not ignore signals that the parent ignores: SIGHUP below nohup, SIGINT in the background."""
    for number in (signal.SIGHUP, signal.SIGINT):
        signal.signal(number, signal.SIG_DFL)


def started(python: Path, path: Path) -> tuple[subprocess.Popen, psutil.Process]:
    """Start a script that sleeps; return its client and the fork."""
    client = subprocess.Popen(
        [python, path], env=environment(), stdout=subprocess.PIPE, text=True, preexec_fn=default_signals
    )
    return client, psutil.Process(int(client.stdout.readline()))


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGHUP])
def test_a_fork_ends_with_its_client(python, script, number):
    client, fork = started(python, script(SLEEP))
    client.send_signal(number)
    assert client.wait(10) != 0
    fork.wait(10)


def test_ctrl_c_reaches_the_fork_once_and_the_client_waits_for_its_end(python, script):
    client, fork = started(python, script(SLEEP))
    client.send_signal(signal.SIGINT)
    assert client.communicate(timeout=10)[0] == "stopped\n"
    assert client.returncode == 130
    fork.wait(10)


def test_the_end_of_a_fork_without_an_exit_code_is_an_error(python, script):
    client, fork = started(python, script(SLEEP))
    fork.kill()
    assert client.wait(10) == 137


def test_jobs_of_a_run_are_forks_with_the_imports_and_the_server_ends_with_the_run(tmp_path):
    scripts = tmp_path / "a run" / "workflow/scripts"
    scripts.mkdir(parents=True)
    text = (
        "import sys\nis_there = 'polarsim.paths' in sys.modules\nopen(snakemake.output[0], 'w').write(str(is_there))\n"
    )
    (scripts / "forked.py").write_text(text)
    (scripts / "other.py").write_text("from polarsim.paths import RunPaths\n")
    folder = scripts.parents[1]
    (folder / "Snakefile").write_text(SNAKEFILE)
    call = [sys.executable, "-c", RUN, "--cores", "2", "-q", "all"]
    (folder / ".snakemake").mkdir()
    run = subprocess.Popen(call, cwd=folder, env=environment(MARK=str(folder)), stderr=subprocess.PIPE, text=True)
    assert run.wait(100) == 0, run.stderr.read()
    assert (folder / "forked.txt").read_text() == "True"
    left = [process for process in psutil.process_iter(["environ"]) if (process.info["environ"] or {}).get("MARK")]
    psutil.wait_procs(left, timeout=10)
    assert not [process for process in left if process.is_running() and process.environ().get("MARK") == str(folder)]
