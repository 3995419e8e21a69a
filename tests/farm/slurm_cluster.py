"""A cluster of Slurm on this machine: one controller and some nodes that are processes here.

As root, in a folder of its own; without systemd, control groups and a database, and without touching a cluster that
the machine may belong to. Nodes have no hosts of their own: they differ by port.
"""

import os
import shutil
import signal
import socket
import subprocess
import time
from pathlib import Path

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "squeue", "scancel", "scontrol", "sinfo")

CONF = """ClusterName=farm
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={port}
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket={here}/munge.socket,cred_expire={expire}
CredType=cred/munge
StateSaveLocation={here}/controller
SlurmdSpoolDir={here}/%n
SlurmctldPidFile={here}/controller.pid
SlurmdPidFile={here}/%n.pid
SlurmctldLogFile={here}/controller.log
SlurmdLogFile={here}/%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/linux
JobAcctGatherFrequency=task=1
JobAcctGatherParams=OverMemoryKill
AccountingStorageType=accounting_storage/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
SchedulerType=sched/backfill
SchedulerParameters=bf_interval=1,sched_interval=1,batch_sched_delay=0
SlurmdParameters=config_overrides
SlurmdTimeout={timeout}
SlurmctldTimeout=10
MessageTimeout=5
KillWait=3
ReturnToService=2
NodeName=n[1-{nodes}] NodeHostname={host} NodeAddr=127.0.0.1 Port={first}-{last} CPUs=2 RealMemory=2000 State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


def missing():
    """Says why there can be no cluster; empty when there can."""
    if os.geteuid() != 0:
        return "only root can start a cluster"
    absent = [program for program in PROGRAMS if not shutil.which(program)]
    return f"{', '.join(absent)} is not installed (slurm-wlm)" if absent else ""


def free_ports(count):
    """Returns the first of consecutive ports that nobody uses."""
    for first in range(17000, 60000, 50):
        try:
            for port in range(first, first + count):
                with socket.socket() as probe:
                    probe.bind(("127.0.0.1", port))
            return first
        except OSError:
            continue
    raise RuntimeError("no ports are free")


class Cluster:
    def __init__(self, here, nodes=4):
        """Starts a cluster. `here` is a folder with a short name, for sockets."""
        self.here, self.names = Path(here), [f"n{i + 1}" for i in range(nodes)]
        host, port = socket.gethostname().split(".")[0], free_ports(nodes + 1)
        os.chmod(here, 0o755)
        (self.here / "controller").mkdir()
        conf = CONF.format(host=host, here=here, port=port, first=port + 1, last=port + nodes, nodes=nodes,
                           expire=5, timeout=5)
        (self.here / "slurm.conf").write_text(conf)
        (self.here / "cgroup.conf").write_text("CgroupPlugin=cgroup/v1\n")
        key = self.here / "munge.key"
        key.write_bytes(os.urandom(128))
        key.chmod(0o600)
        self.environment = dict(os.environ, SLURM_CONF=str(self.here / "slurm.conf"))
        self.call("munged", f"--socket={here}/munge.socket", f"--key-file={key}", f"--pid-file={here}/munge.pid",
                  f"--log-file={here}/munge.log", f"--seed-file={here}/munge.seed")
        self.start_controller()
        for name in self.names:
            (self.here / name).mkdir()
            self.call("slurmd", "-N", name)
        self.wait("nodes", lambda: len(set(self.call("sinfo", "-h", "-N", "-t", "idle", "-o", "%N").split())) == nodes)

    def call(self, *words):
        done = subprocess.run(words, env=self.environment, capture_output=True, text=True, timeout=60)
        if done.returncode != 0:
            raise RuntimeError(f"{words}: {done.stdout}{done.stderr}")
        return done.stdout

    def wait(self, what, condition, seconds=60):
        end = time.time() + seconds
        while not condition():
            if time.time() > end:
                raise RuntimeError(f"{what}: nothing after {seconds} s\n" + (self.here / "controller.log").read_text()[-3000:])
            time.sleep(0.1)

    def pid(self, name):
        try:
            return int((self.here / f"{name}.pid").read_text())
        except (OSError, ValueError):
            return None

    def start_controller(self):
        self.call("slurmctld")

    def stop_controller(self):
        pid = self.pid("controller")
        os.kill(pid, signal.SIGTERM)
        self.wait("controller", lambda: not Path(f"/proc/{pid}").exists())

    def processes(self, node):
        """The processes of the jobs of a node, and the daemons that started them."""
        found = set()
        for environ in Path("/proc").glob("[0-9]*/environ"):
            try:
                entries = environ.read_bytes().split(b"\0")
                if f"SLURMD_NODENAME={node}".encode() in entries and f"SLURM_CONF={self.here}/slurm.conf".encode() in entries:
                    stat = (environ.parent / "stat").read_text()
                    found |= {int(environ.parent.name), int(stat.rsplit(")", 1)[1].split()[1])}
            except OSError:
                continue
        return found - {0, 1, os.getpid()}

    def kill_node(self, node):
        """Ends a node with all that runs on it, as a power loss would."""
        victims = self.processes(node) | {self.pid(node)}
        for number in (signal.SIGSTOP, signal.SIGKILL):  # none sees another one go, and tells the controller
            for pid in victims:
                try:
                    os.kill(pid, number)
                except ProcessLookupError:
                    pass
        return victims

    def stop(self):
        for name in self.names:
            self.kill_node(name) if self.pid(name) else None
        for name in ("controller", "munge"):
            if self.pid(name):
                try:
                    os.kill(self.pid(name), signal.SIGKILL)
                except ProcessLookupError:
                    pass
