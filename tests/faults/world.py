"""Shared by all faults: a small scene, an undisturbed training of it, and checks of gflow's messages and files
after a fault."""
import hashlib
import json
import os
import re
import shutil
import signal
import struct
import subprocess
import time
import zipfile

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))

# Two cameras, three time steps, 32 x 24 pixels, ten training steps: takes about a second and uses files and the
# device in every way at least once: density control, two intermediate checkpoints, a third at the end.
CHECKPOINTS = (4, 8, 10)
SETTINGS = ["scene.resolution=8", "scene.max_steps=3", "train.iterations=10", "train.checkpoint_every=4",
            "train.log_every=4", "init.dynamic=100", "density.cap=1000", "density.start=4", "density.every=3"]


class Outcome:
    """How a command ended: code (negative for a signal, None for a timeout), out, err."""

    def __init__(self, code, out, err):
        self.code, self.out, self.err = code, out, err

    def warnings(self):
        return [line for line in self.err.splitlines() if line.startswith("gflow: warning: ")]

    def last_line(self):
        lines = self.err.strip().splitlines()
        return f"exit code {self.code}: {lines[-1] if lines else 'nothing said'}"


def complaints(outcome, codes, needles=()):
    """Errors in how a command ended. Its code must be one of `codes`; unless it is 0, stderr contains one sentence
    besides warnings, with each of the needles (a word, or a tuple of alternatives)."""
    if outcome.code is None:
        return ["it hangs"]
    if outcome.code < 0:
        return [f"it died of signal {-outcome.code}: {outcome.err.strip()[-200:]}"]
    wrong = []
    if outcome.code not in codes:
        wrong.append(outcome.last_line())
    if outcome.code == 0:
        return wrong
    # After a failed build the compiler's log follows.
    log = "\nbuild log of " in outcome.err
    said = [line for line in outcome.err.splitlines() if line and not line.startswith("gflow: warning: ")]
    if not said or not said[0].startswith("gflow: ") or (len(said) > 1 and not log):
        wrong.append(f"not one sentence: {outcome.err.strip()!r}")
    for needle in needles:
        words = (needle,) if isinstance(needle, str) else needle
        if said and not any(word in said[0] for word in words):
            wrong.append(f"does not say {' or '.join(words)!r}: {said[0]}")
    if "internal error" in outcome.err:
        wrong.append(said[0])
    return wrong


def unfinished_in(folder):
    """Temporaries left behind."""
    return [os.path.join(where, name) for where, _, names in os.walk(folder) for name in names
            if re.match(r"\..*\.\d+-\d+\.part", name)]


def without_times(text):
    return re.sub(r'"((train_)?seconds|peak_memory_mib)": ?[^,\n]*,?', "", text)


def content(path):
    with open(path, "rb") as file:
        return file.read()


def contents_under(folder):
    return {os.path.relpath(os.path.join(where, name), folder): content(os.path.join(where, name))
            for where, _, names in os.walk(folder) for name in names}


class World:
    def __init__(self, gflow, work):
        self.work = work
        # A copy, because checkpoints name the program that wrote them and a rebuild would change it.
        self.gflow = shutil.copy(gflow, self.path("gflow"))
        self.of_sanitizer = self._of_sanitizer(self.gflow)
        self.scene = os.path.join(work, "scene")
        self._make_scene()
        self.shims = {name: self._shim(name) for name in ("fail_io", "fail_opencl", "fail_thread", "clock_jumps")}
        self.whole = self.path("whole")
        first = self.train(self.whole)
        if first.code != 0:
            raise SystemExit(f"without a fault the training must succeed: {first.err}")
        self.expected = self.left_in(self.whole)
        self.stopped = self._stopped_training()
        again = self.path("again")
        shutil.copytree(self.stopped, again)
        if self.resumed_as_undisturbed(again):
            raise SystemExit("an undisturbed training and a resumed one differ: faults cannot be checked against them")

    def path(self, name):
        return os.path.join(self.work, name)

    def _make_scene(self):
        """The first three cameras of the demo scene."""
        source = os.path.join(ROOT, "apps/demo/scene")
        os.makedirs(self.scene)
        poses = content(os.path.join(source, "poses_bounds.npy"))
        start = 10 + struct.unpack("<H", poses[8:10])[0]
        header = poses[:start].replace(b"(9, 17)", b"(3, 17)")
        with open(os.path.join(self.scene, "poses_bounds.npy"), "wb") as file:
            file.write(header + poses[start:start + 3 * 17 * 8])
        for name in ("cam00", "cam01.mp4", "cam02.mp4", "points3D.ply", "flow"):
            os.symlink(os.path.join(source, name), os.path.join(self.scene, name))

    def _shim(self, name):
        library = self.path(name + ".so")
        subprocess.run(["cc", "-std=gnu11", "-O1", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC",
                        os.path.join(HERE, name + ".c"), "-o", library, "-ldl"], check=True)
        return library

    def _stopped_training(self):
        """A run killed between its checkpoints of steps 4 and 8."""
        run = self.path("stopped")
        for _ in range(50):
            shutil.rmtree(run, ignore_errors=True)
            process = self.start(["train", self.scene, "-o", run, *settings()])
            while process.poll() is None and not os.path.exists(self.checkpoint(run, 4)):
                time.sleep(0.001)
            process.kill()
            process.communicate()
            if checkpoints_of(run) == [4]:
                for part in unfinished_in(run):
                    os.remove(part)
                return run
        raise SystemExit("no training could be killed between steps 4 and 8")

    @staticmethod
    def checkpoint(run, step):
        return f"{run}/checkpoints/iteration_{step}.npz"

    @staticmethod
    def model(run):
        return f"{run}/point_cloud/iteration_10/point_cloud.ply"

    @staticmethod
    def _of_sanitizer(gflow):
        """Environment of a program built with the address sanitizer: its library first, PoCL's driver only, and leak
        detection except for leaks of PoCL's compiler. The exit code of a report is 23, which is never right."""
        linked = subprocess.run(["ldd", gflow], capture_output=True, text=True).stdout
        libraries = re.findall(r"/\S*/libasan\.so\S*", linked)
        allowed = os.path.join(ROOT, "tests/sanitizers/lsan.supp")
        return {"LD_PRELOAD": libraries[0], "OCL_ICD_VENDORS": "/etc/OpenCL/vendors/pocl.icd",
                "ASAN_OPTIONS": "detect_leaks=1:exitcode=23",
                "LSAN_OPTIONS": f"suppressions={allowed}:print_suppressions=0"} if libraries else {}

    def start(self, arguments, env=None, ignored=()):
        env = {**self.of_sanitizer, **(env or {})}
        if self.of_sanitizer and env["LD_PRELOAD"] != self.of_sanitizer["LD_PRELOAD"]:
            env["LD_PRELOAD"] = self.of_sanitizer["LD_PRELOAD"] + " " + env["LD_PRELOAD"]

        def signals():
            signal.signal(signal.SIGINT, signal.SIG_DFL)
            for number in ignored:
                signal.signal(number, signal.SIG_IGN)
        return subprocess.Popen([self.gflow, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                                errors="surrogateescape", env={**os.environ, **env},
                                preexec_fn=signals)

    def run(self, arguments, env=None):
        return ended(self.start(arguments, env))

    def train(self, run, env=None):
        return self.run(["train", self.scene, "-o", run, *settings()], env)

    def resume(self, run, env=None):
        return self.run(["train", self.scene, "-o", run, "--resume", *settings()], env)

    def left_in(self, run):
        """Files of a training by name, without what depends on the clock or on memory use."""
        left = {}
        names = ["per_view.json", "compare.png", "config.toml", "cameras.json",
                 *(f"test/cam00_000{i}.png" for i in range(3)), "point_cloud/iteration_10/point_cloud.ply"]
        for name in names:
            path = os.path.join(run, name)
            left[name] = hashlib.sha256(content(path)).hexdigest() if os.path.exists(path) else "missing"
        for name in ("metrics.jsonl", "results.json", "training.json"):
            path = os.path.join(run, name)
            left[name] = without_times(content(path).decode()) if os.path.exists(path) else "missing"
        table = os.path.join(run, "metrics.csv")
        rows = content(table).decode().splitlines() if os.path.exists(table) else []
        left["metrics.csv"] = [[row.split(",")[0], *row.split(",")[2:]] for row in rows]
        return left

    def differences(self, run, lost=()):
        """Differences between a finished training and the undisturbed one, except files in `lost`."""
        left = self.left_in(run)
        wrong = [f"{name} is not as without the fault" for name in self.expected
                 if name not in lost and left[name] != self.expected[name]]
        wrong += [f"{path} was left behind" for path in unfinished_in(run)]
        return wrong + broken_checkpoints(run)

    def resumed_as_undisturbed(self, run, lost=()):
        """Resumes without faults and returns the errors."""
        outcome = self.resume(run)
        return complaints(outcome, (0,)) + (self.differences(run, lost) if outcome.code == 0 else [])


def seconds_of_work(pid):
    try:
        fields = open(f"/proc/{pid}/stat", encoding="ascii", errors="replace").read().rsplit(")", 1)[1].split()
    except OSError:
        return 0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def ended(process):
    """How it ended. It hangs if it uses no CPU for a minute, or works for two."""
    done = -1.0
    while True:
        try:
            out, err = process.communicate(timeout=60)
            return Outcome(process.returncode, out, err)
        except subprocess.TimeoutExpired:
            before, done = done, seconds_of_work(process.pid)
            if done > 120 or done - before < 0.01:
                process.kill()
                return Outcome(None, *process.communicate())


def settings():
    return ["--quiet", *(word for setting in SETTINGS for word in ("--set", setting))]


def checkpoints_of(run):
    """Steps of the existing checkpoints."""
    names = os.listdir(run + "/checkpoints") if os.path.isdir(run + "/checkpoints") else []
    return sorted(int(m.group(1)) for m in (re.fullmatch(r"iteration_(\d+)\.npz", name) for name in names) if m)


def broken_checkpoints(run):
    """Incomplete checkpoints under final names, by a reader independent of gflow."""
    wrong = []
    for step in checkpoints_of(run):
        path = World.checkpoint(run, step)
        try:
            with zipfile.ZipFile(path) as archive:
                damaged = archive.testzip()
                facts = json.loads(archive.read("facts.npy").split(b"\n", 1)[1])
            if damaged or facts["step"] != step:
                wrong.append(f"{path} is damaged")
        except (zipfile.BadZipFile, OSError, ValueError, KeyError) as problem:
            wrong.append(f"{path} is damaged: {problem}")
    return wrong


def failed_calls(report):
    """The calls that a shim failed, as (number, name and path), and all calls."""
    lines = [line for line in reported(report) if line[1] != "left"]
    calls = [(int(line[0]), " ".join(line[2:])) for line in lines]
    return [call for call, line in zip(calls, lines) if line[1] == "failed"], calls


def leaks(report):
    """OpenCL objects that were created and not released."""
    return [f"not let go of: {' '.join(line[2:])}" for line in reported(report) if line[1] == "left"]


def reported(report):
    if not os.path.exists(report):
        return []
    return [line.rstrip("\n").split(" ", 3) for line in open(report, encoding="utf-8", errors="replace")]
