"""A real Slurm of two nodes on one machine: the controller, two daemons that each offer one CPU, and munge.

Needs root and the packages slurm-wlm and munge.  Slurm's commands read /etc/slurm inside jobs too (Snakemake's plugin
clears SLURM_CONF), so the configuration is written there, never over one that somebody else wrote, and removed again.
"""

import contextlib
import os
import shutil
import socket
import subprocess
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import psutil

CONFIGURATION = Path("/etc/slurm/slurm.conf")
CGROUPS = Path("/etc/slurm/cgroup.conf")
MUNGE = Path("/run/munge")
MARK = "# Written by tests/slurm, which removes it again.\n"
NODES = ("node1", "node2")
PROGRAMS = ("slurmctld", "slurmd", "munged", "sbatch", "srun", "squeue", "scontrol")
LOST_AFTER_S = 20  # a node that is silent for so long is down
SETTINGS = """\
ClusterName=thesis
SlurmctldHost={host}(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool/%n
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.%n.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.%n.log
SlurmctldPort=16817
SlurmdTimeout={lost_after_s}
ReturnToService=2
MpiDefault=none
SwitchType=switch/none
ProctrackType=proctrack/{tracking}
TaskPlugin=task/{task}
JobAcctGatherType=jobacct_gather/none
SchedulerType=sched/backfill
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
AccountingStorageType=accounting_storage/none
JobCompType=jobcomp/filetxt
JobCompLoc={folder}/finished.log
NodeName=node[1-2] NodeHostname={host} NodeAddr=127.0.0.1 Port=[17001-17002] CPUs=1 RealMemory={memory_mb} State=UNKNOWN
PartitionName=main Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""
# both nodes are this machine: bound to cores they would share one
CGROUP_SETTINGS = """\
CgroupPlugin=cgroup/v1
CgroupMountpoint=/sys/fs/cgroup
ConstrainCores=no
ConstrainRAMSpace=yes
"""


def why_not() -> str | None:
    """Reason for which no Slurm can be started here, None if it can."""
    missing = [name for name in PROGRAMS if shutil.which(name) is None]
    if missing:
        return f"{', '.join(missing)} not installed (apt-get install slurm-wlm munge)"
    if os.geteuid() != 0:
        return "Slurm's daemons must be started by root"
    if not _is_ours() and (CONFIGURATION.exists() or _slurm_daemons()):
        return f"this machine belongs to a Slurm ({CONFIGURATION} or its daemons), which is left alone"
    return None


def seconds_of(written: str) -> float:
    """A time as Slurm writes it, in the seconds of `time.time`."""
    return time.mktime(time.strptime(written, "%Y-%m-%dT%H:%M:%S"))


@dataclass
class TwoNodes:
    """The running cluster; `daemons` by node."""

    folder: Path
    daemons: dict[str, psutil.Process]

    def running(self, node: str) -> dict[str, float]:
        """Job id -> seconds, of the jobs that run on a node."""
        listed = _output("squeue", "-h", "-w", node, "-t", "R", "-o", "%i %S").splitlines()
        now = time.time()
        return {job: now - seconds_of(start) for job, start in map(str.split, listed)}

    def finished(self) -> list[dict[str, str]]:
        """What Slurm noted of each job that ended: JobId, JobState, NodeList, StartTime, EndTime, ..."""
        log = self.folder / "finished.log"
        lines = log.read_text().splitlines() if log.exists() else []
        return [dict(word.split("=", 1) for word in line.split() if "=" in word) for line in lines]

    def completed(self) -> Counter[str]:
        """Completed jobs by node."""
        return Counter(job["NodeList"] for job in self.finished() if job["JobState"] == "COMPLETED")

    def kill(self, node: str) -> list[str]:
        """What a power cut does: the daemon of a node and all processes of its jobs die at once.

        Returns:
            The ids of the jobs that ran there.
        """
        jobs = list(self.running(node))
        _kill([self.daemons.pop(node), *_steps(jobs)])
        return jobs


@contextlib.contextmanager
def two_nodes(folder: Path) -> Iterator[TwoNodes]:
    """Start the cluster with its state in `folder`; end it and remove its configuration in every case.

    One at a time: what an earlier run left, because it was killed, is ended first.
    """
    _clear()
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("state", *(f"spool/{node}" for node in NODES)):
        (folder / name).mkdir(parents=True, exist_ok=True)
    own_munge = None
    try:
        own_munge = _start_munge()
        _write_configuration(folder)
        _run("slurmctld")
        for node in NODES:
            _run("slurmd", "-N", node)
        _wait(lambda: _output("sinfo", "-h", "-t", "idle", "-o", "%D") == str(len(NODES)), "nodes became idle")
        yield TwoNodes(folder, {node: _daemon(folder / f"slurmd.{node}.pid") for node in NODES})
    finally:
        if own_munge is not None:
            _kill([own_munge])
        _clear()


def _clear() -> None:
    """End what a run left, this one or one that was killed: daemons, their jobs, configuration, empty cgroups."""
    if not _is_ours():
        return
    _kill([*_slurm_daemons(), *_steps()])
    for path in (CONFIGURATION, CGROUPS):
        if path.exists() and path.read_text().startswith(MARK):
            path.unlink()
    for node in NODES:
        for group in sorted(Path("/sys/fs/cgroup").glob(f"*/slurm_{node}/**/"), reverse=True):  # the deepest first
            with contextlib.suppress(OSError):
                group.rmdir()


def _is_ours() -> bool:
    return CONFIGURATION.exists() and CONFIGURATION.read_text().startswith(MARK)


def _slurm_daemons() -> list[psutil.Process]:
    return [p for p in psutil.process_iter(["name"]) if p.info["name"] in ("slurmctld", "slurmd")]


def _write_configuration(folder: Path) -> None:
    memory_mb = int(0.45 * psutil.virtual_memory().total / 2**20)
    cgroups = Path("/sys/fs/cgroup/memory").is_dir()  # version 1; else memory is not enforced
    text = SETTINGS.format(
        host=socket.gethostname().split(".")[0],
        folder=folder,
        memory_mb=memory_mb,
        lost_after_s=LOST_AFTER_S,
        tracking="cgroup" if cgroups else "linuxproc",
        task="cgroup" if cgroups else "none",
    )
    CONFIGURATION.parent.mkdir(exist_ok=True)
    CONFIGURATION.write_text(MARK + text)
    if cgroups and not CGROUPS.exists():
        CGROUPS.write_text(MARK + CGROUP_SETTINGS)


def _start_munge() -> psutil.Process | None:
    """Start munge; None if it runs already."""
    if subprocess.run(["munge", "-n"], capture_output=True).returncode == 0:
        return None
    _run("install", "-d", "-o", "munge", "-g", "munge", str(MUNGE))
    _run("runuser", "-u", "munge", "--", "munged", f"--pid-file={MUNGE}/munged.pid")
    return _daemon(MUNGE / "munged.pid")


def _daemon(pid_file: Path) -> psutil.Process:
    _wait(pid_file.exists, f"{pid_file} was written", 30.0)
    return psutil.Process(int(pid_file.read_text()))


def _steps(jobs: Iterable[str] = ("",)) -> list[psutil.Process]:
    """Slurm's supervisors of jobs (of all: no other Slurm is here) and every process below them."""
    found = []
    for process in psutil.process_iter(["cmdline"]):
        command = " ".join(process.info["cmdline"] or ())
        if any(command.startswith(f"slurmstepd: [{job}{'.' if job else ''}") for job in jobs):
            with contextlib.suppress(psutil.NoSuchProcess):
                found += [process, *process.children(recursive=True)]
    return found


def _kill(processes: list[psutil.Process]) -> None:
    for process in processes:
        with contextlib.suppress(psutil.NoSuchProcess):
            process.kill()
    psutil.wait_procs(processes, timeout=30)


def _wait(done: Callable[[], bool], what: str, seconds: float = 120.0) -> None:
    end = time.monotonic() + seconds
    while not done():
        if time.monotonic() > end:
            raise TimeoutError(f"not after {seconds:g} s: {what}")
        time.sleep(1.0)


def _run(*command: str) -> None:
    subprocess.run(command, check=True, capture_output=True, timeout=120)


def _output(*command: str) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True, timeout=120).stdout.strip()
