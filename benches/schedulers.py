"""Does a campaign launched on a real scheduler have the results of one local campaign?

Starts Slurm (Debian's slurm-wlm and munge) with two nodes on this machine, and a cluster of Ray with several nodes. Runs the same
campaign once locally and several times with `actcheck launch`, undisturbed and with a lost process, task, controller, node
or launch. Compares every status, score, trace digest, outcome and margin. Checks the Indexed Job against the published schemas.

    apt-get install slurm-wlm munge
    pip install ray kubernetes-validate
    python benches/schedulers.py ACTCHECK [CONFIG [RUNS]]

Needs to run as root, for munge. Prints a line for each launch, and exits with 1 if a result differs.
"""

import os
import pathlib
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = os.path.abspath(sys.argv[1])
CONFIG = sys.argv[2] if len(sys.argv) > 2 else str(ROOT / "configs/pick.toml")
RUNS = sys.argv[3] if len(sys.argv) > 3 else "400"
SHARDS = "20"
KUBERNETES = ["1.31", "1.34", "1.37"]
OUTCOMES = """SELECT ?index ?property ?mode ?outcome ?margin WHERE {
  ?assertion earl:subject/act:ofRun ?run ; earl:test ?property ; earl:result ?result ; earl:mode ?mode .
  ?run act:index ?index . ?result act:outcome ?outcome . OPTIONAL { ?result act:margin ?margin } }"""


def output(*command, **options):
    done = subprocess.run(command, capture_output=True, text=True, **options)
    if done.returncode not in (0, 1):
        sys.exit(f"{command}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def results(history):
    """Everything that was concluded about the runs, without their ids, times and places."""
    listed = output(PROGRAM, "list", "--history", history, "--format", "csv").splitlines()
    asked = output(PROGRAM, "query", OUTCOMES, "--history", history, "--format", "csv").splitlines()
    return [line.split(",", 1)[1] for line in listed[1:]], sorted(asked[1:])


class Comparison:
    """The results of one local campaign, and the launches that must have the same."""

    def __init__(self, folder):
        self.folder = folder
        history = str(folder / "whole")
        output(PROGRAM, "run", CONFIG, "--runs", RUNS, "--jobs", "2", "--history", history)
        self.expected = results(history)
        self.differing = 0
        print(f"one campaign: {len(self.expected[0])} runs, {len(self.expected[1])} outcomes", flush=True)

    def launch(self, name, on, disturb=None, again=False):
        """`disturb` gets the process of the launch and the folder of its shards. With `again` it ends the launch."""
        history = str(self.folder / "launched")
        command = [PROGRAM, "launch", CONFIG, "--runs", RUNS, "--shards", SHARDS, "--history", history, *on]
        started = time.monotonic()
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        note = disturb(process, pathlib.Path(history + ".launch")) if disturb else "undisturbed"
        said, _ = process.communicate()
        if again:
            done = subprocess.run(command, capture_output=True, text=True)
            process.returncode, said = done.returncode, done.stdout + done.stderr
        wall = time.monotonic() - started
        if process.returncode not in (0, 1):
            print(said)
            self.differing += 1
            return print(f"{name}, {note}: exit code {process.returncode} after {wall:.0f} s", flush=True)
        equal = results(history) == self.expected
        self.differing += not equal
        print(f"{name}, {note}: {'equal' if equal else 'DIFFERENT'} after {wall:.0f} s", flush=True)
        shutil.rmtree(history)


def shards_of(folder):
    """Processes that run a shard of this launch."""
    found = subprocess.run(["pgrep", "-f", f"launch-task {folder}"], capture_output=True, text=True)
    return [int(line) for line in found.stdout.split()]


def begun(folder):
    """Waits until some shards have run."""
    while not shards_of(folder):
        time.sleep(0.2)
    time.sleep(random.uniform(3, 8))


def kill_a_shard(process, folder):
    begun(folder)
    killed = 0
    for _ in range(3):
        chosen = [shard for shard in shards_of(folder) if program_of(shard) == "actcheck"]
        if chosen:
            os.kill(random.choice(chosen), signal.SIGKILL)
            killed += 1
        time.sleep(random.uniform(1, 4))
    return f"{killed} processes of shards killed"


def program_of(pid):
    try:
        return "actcheck" if os.readlink(f"/proc/{pid}/exe") == os.path.realpath(PROGRAM) else "other"
    except OSError:
        return "ended"


def kill_the_launch(process, folder):
    begun(folder)
    process.kill()
    return "launch killed, and given again"


# Slurm


class Slurm:
    """A controller and two nodes on loopback, in a folder of its own."""

    def __init__(self, folder):
        self.folder = folder
        self.programs = {}
        host = os.uname().nodename
        (folder / "spool1").mkdir(parents=True)
        (folder / "state").mkdir()
        self.config = folder / "slurm.conf"
        self.config.write_text(
            f"""ClusterName=actcheck
SlurmctldHost={host}(127.0.0.1)
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CryptoType=crypto/munge
ProctrackType=proctrack/pgid
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_res
SelectTypeParameters=CR_Core
ReturnToService=2
JobRequeue=1
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool1
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
NodeName={host} NodeAddr=127.0.0.1 CPUs={os.cpu_count()} State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""
        )
        os.environ["SLURM_CONF"] = str(self.config)
        key = folder / "munge.key"
        key.write_bytes(os.urandom(128))
        key.chmod(0o600)
        for owned in [key, folder]:
            shutil.chown(owned, "root", "root")
        self.start(
            "munged", "--foreground", "--force", f"--key-file={key}", f"--socket={folder}/munge.socket",
            f"--log-file={folder}/munged.log", f"--pid-file={folder}/munged.pid", f"--seed-file={folder}/munged.seed",
        )  # fmt: skip
        time.sleep(1)
        self.start("slurmctld", "-D")
        self.start("slurmd", "-D")
        for _ in range(60):
            if "idle" in output("sinfo", "-h", "-o", "%T"):
                return
            time.sleep(0.5)
        sys.exit(f"Slurm does not start: see {folder}")

    def start(self, name, *options):
        log = open(self.folder / f"{name}.out", "a")
        self.programs[name] = subprocess.Popen([f"/usr/sbin/{name}", *options], stdout=log, stderr=log)

    def cancel_a_task(self, process, folder):
        begun(folder)
        tasks = output("squeue", "-h", "-r", "-t", "R", "-o", "%i").split()
        output("scancel", tasks[0])
        return "a task cancelled"

    def requeue_a_task(self, process, folder):
        begun(folder)
        tasks = output("squeue", "-h", "-r", "-t", "R", "-o", "%i").split()
        output("scontrol", "requeue", tasks[0])
        return "a task requeued"

    def release(self):
        """Lets the node and the tasks that are held run again, as an administrator does after a loss."""
        subprocess.run(["scontrol", "update", f"nodename={os.uname().nodename}", "state=resume"], capture_output=True)
        for task in set(output("squeue", "-h", "-t", "PD", "-o", "%A").split()):
            subprocess.run(["scontrol", "release", task], capture_output=True)

    def lose_the_controller(self, process, folder):
        begun(folder)
        self.programs["slurmctld"].kill()
        self.programs["slurmctld"].wait()
        time.sleep(4)
        self.start("slurmctld", "-D")
        # It has forgotten the last seconds, and may drain a node with tasks that it does not know.
        time.sleep(15)
        self.release()
        return "slurmctld killed and started again"

    def lose_the_node(self, process, folder):
        begun(folder)
        self.programs["slurmd"].kill()
        self.programs["slurmd"].wait()
        lost = [pid for pid in shards_of(folder)]
        for pid in lost:
            os.kill(pid, signal.SIGKILL)
        output("scontrol", "update", f"nodename={os.uname().nodename}", "state=down", "reason=lost")
        time.sleep(4)
        self.start("slurmd", "-D")
        self.release()
        return f"the node lost with {len(lost)} processes, and started again"

    def end(self):
        for program in reversed(self.programs.values()):
            program.kill()
            program.wait()


def on_slurm(comparison, folder):
    slurm = Slurm(folder / "slurm")
    on = ["--on", "slurm", "--resources", "cpus=1"]
    try:
        comparison.launch("Slurm", on)
        comparison.launch("Slurm", on, kill_a_shard)
        comparison.launch("Slurm", on, slurm.cancel_a_task)
        comparison.launch("Slurm", on, slurm.requeue_a_task)
        comparison.launch("Slurm", on, slurm.lose_the_controller)
        comparison.launch("Slurm", on, slurm.lose_the_node)
        comparison.launch("Slurm", on, kill_the_launch, again=True)
    finally:
        slurm.end()


# Ray


class Ray:
    """A head without room for tasks, and two nodes on the same machine."""

    def __init__(self):
        from ray.cluster_utils import Cluster

        self.cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, "include_dashboard": False})
        self.nodes = [self.cluster.add_node(num_cpus=1), self.cluster.add_node(num_cpus=1)]

    def lose_a_node(self, process, folder):
        begun(folder)
        self.cluster.remove_node(self.nodes.pop(), allow_graceful=False)
        time.sleep(3)
        self.nodes.append(self.cluster.add_node(num_cpus=1))
        return "a node taken away, and another one added"


def on_ray(comparison):
    ray = Ray()
    on = ["--on", "ray", "--resources", f"cpus=1,address={ray.cluster.address},python={sys.executable}"]
    try:
        comparison.launch("Ray", on)
        comparison.launch("Ray", on, kill_a_shard)
        comparison.launch("Ray", on, ray.lose_a_node)
        comparison.launch("Ray", on, kill_the_launch, again=True)
    finally:
        ray.cluster.shutdown()


# Kubernetes


def for_kubernetes(folder):
    """Checks the Indexed Job against the published schemas. Returns the number of versions that refuse it."""
    history = folder / "on_kubernetes"
    needs = f"image=actcheck:0.1.0,volume=projects,mount=/,cpus=2,memory=4G,time=1h,namespace=robots,program={PROGRAM}"
    command = [PROGRAM, "launch", CONFIG, "--runs", RUNS, "--shards", SHARDS, "--history", str(history)]
    said = output(*command, "--on", "kubernetes", "--resources", needs, "--dry-run")
    lines = said.splitlines()
    first = next(number for number, line in enumerate(lines) if line.startswith("# ") and line.endswith((".yaml", ".json")) and "plan" not in line)
    last = next(number for number, line in enumerate(lines) if number > first and line.startswith("# "))
    manifest = folder / pathlib.Path(lines[first][2:]).name
    manifest.write_text("\n".join(lines[first + 1 : last]))
    refused = 0
    for version in KUBERNETES:
        tool = str(pathlib.Path(sys.executable).parent / "kubernetes-validate")
        done = subprocess.run([tool, "--strict", "-k", version, str(manifest)], capture_output=True, text=True)
        print(f"Kubernetes {version}: {'valid' if done.returncode == 0 else done.stdout + done.stderr}")
        refused += done.returncode != 0
    return refused


def main():
    missing = [name for name in ["munged", "slurmctld", "slurmd"] if not shutil.which(name, path="/usr/sbin:/usr/bin")]
    if missing or os.geteuid() != 0:
        sys.exit("run this as root, after: apt-get install slurm-wlm munge")
    random.seed(1)
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        differing = for_kubernetes(folder)
        comparison = Comparison(folder)
        on_slurm(comparison, folder)
        on_ray(comparison)
        differing += comparison.differing
    print("all equal" if differing == 0 else f"{differing} differ")
    sys.exit(differing > 0)


if __name__ == "__main__":
    main()
