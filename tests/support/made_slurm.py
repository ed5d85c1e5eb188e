"""A SLURM of one node on the loopback interface, for tests and benchmarks of faults; requires root."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

CORES, MEMORY_MB = 2, 8000
REQUEUE_S = 20  # time until a requeued job starts again: lifetime of the credential, default 120 s
# Default path of all SLURM commands: steps of a job do not inherit `SLURM_CONF`.
CONFIGURATION = Path("/etc/slurm/slurm.conf")
PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "squeue", "sinfo", "scancel", "scontrol", "srun")

SLURM_CONF = """\
ClusterName=polarsim
SlurmctldHost={host}(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.sock,cred_expire={requeue_s}
MpiDefault=none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
JobCompType=jobcomp/filetxt
JobCompLoc={folder}/jobs.txt
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
SlurmctldPort=16817
SlurmdPort=16818
ReturnToService=2
MinJobAge=3600
KillWait=3
SchedulerParameters=batch_sched_delay=0,sched_interval=2,bf_interval=2
SlurmdParameters=config_overrides
NodeName={host} NodeAddr=127.0.0.1 CPUs={cores} CoresPerSocket={cores} RealMemory={memory_mb} State=UNKNOWN
PartitionName=main Nodes={host} Default=YES MaxTime=600 State=UP
"""


def why_not() -> str | None:
    """Return the reason why SLURM cannot be started, or an empty text."""
    missing = [name for name in PROGRAMS if shutil.which(name) is None]
    if missing:
        return f"no {', '.join(missing)} (apt-get install --no-install-recommends slurm-wlm munge)"
    if os.geteuid() != 0:
        return "SLURM's daemons want root"
    if CONFIGURATION.exists() or CONFIGURATION.is_symlink():
        return f"{CONFIGURATION} is there: this machine has a SLURM of its own"
    return None


class Slurm:
    """The daemons and their folder."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.host = folder, socket.gethostname().partition(".")[0]

    def start(self) -> None:
        """Start the daemons and wait until the node is idle."""
        for name in ("state", "spool"):
            (self.folder / name).mkdir()
        key = self.folder / "munge.key"
        key.write_bytes(os.urandom(128))
        key.chmod(0o600)
        own = {"host": self.host, "folder": self.folder, "requeue_s": REQUEUE_S}
        text = SLURM_CONF.format(**own, cores=CORES, memory_mb=MEMORY_MB)
        (self.folder / "slurm.conf").write_text(text)
        CONFIGURATION.parent.mkdir(exist_ok=True)
        CONFIGURATION.symlink_to(self.folder / "slurm.conf")
        files = {"key": "key", "socket": "sock", "pid": "pid", "log": "log", "seed": "seed"}
        flags = [
            f"--{kind}{'' if kind == 'socket' else '-file'}={self.folder}/munge.{end}" for kind, end in files.items()
        ]
        for command in (["munged", *flags, "--force"], ["slurmctld", "-i"], ["slurmd"]):
            subprocess.run(command, check=True, timeout=30, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        end = time.monotonic() + 60
        while self.ask("sinfo", "-h", "-o", "%t") != "idle":
            assert time.monotonic() < end, (self.folder / "slurmctld.log").read_text()[-3000:]
            time.sleep(0.2)

    def stop(self) -> None:
        """End all jobs and daemons by their pid files, and remove the link."""
        if (self.folder / "slurmctld.pid").exists():
            subprocess.run(["scancel", "-u", "root"], timeout=30, capture_output=True)
            end = time.monotonic() + 30
            while self.ask("squeue", "-h", "-t", "RUNNING,COMPLETING") and time.monotonic() < end:
                time.sleep(0.5)
        for name in ("slurmd", "slurmctld", "munge"):
            file = self.folder / f"{name}.pid"
            if file.exists():
                end_process(int(file.read_text()))
        if CONFIGURATION.is_symlink() and CONFIGURATION.readlink().parent == self.folder:
            CONFIGURATION.unlink()

    def ask(self, *command: str) -> str:
        """Return the output of a SLURM command."""
        return subprocess.run(command, capture_output=True, text=True, timeout=30).stdout.strip()

    def at_work(self) -> list[str]:
        """Return the numbers of running jobs."""
        return self.ask("squeue", "-h", "-t", "RUNNING", "-o", "%i").split()

    @contextmanager
    def closed(self) -> Iterator[None]:
        """Drain the node."""
        node = ("scontrol", "update", f"nodename={self.host}")
        self.ask(*node, "state=drain", "reason=closed")
        try:
            yield
        finally:
            self.ask(*node, "state=resume")

    def queue(self) -> str:
        """Return every job with state and reason."""
        return self.ask("squeue", "-o", "%i %j %T %r %C %m")

    def ended_jobs(self) -> list[dict[str, str]]:
        """Return the fields (`JobState`, `StartTime` ...) of each ended job."""
        file = self.folder / "jobs.txt"
        lines = file.read_text().splitlines() if file.exists() else []
        return [dict(word.split("=", 1) for word in line.split() if "=" in word) for line in lines]


def end_process(number: int) -> None:
    """End a process with SIGTERM, then SIGKILL."""
    for sent in (signal.SIGTERM, signal.SIGKILL):
        try:
            os.kill(number, sent)
            for _ in range(50):
                time.sleep(0.1)
                os.kill(number, 0)
        except ProcessLookupError:
            return


@contextmanager
def running_slurm() -> Iterator[Slurm]:
    """Run SLURM for the duration of the context; call `why_not` first."""
    with tempfile.TemporaryDirectory(
        prefix="slurm", dir="/tmp"
    ) as folder:  # short path, because socket names are limited
        own = Slurm(Path(folder))
        try:
            own.start()
            yield own
        finally:
            own.stop()
