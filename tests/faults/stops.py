"""Trainings that are killed while saving, interrupted at any moment, or run two at a time."""
import os
import random
import re
import shutil
import signal
import time

from world import (broken_checkpoints, checkpoints_of, complaints, contents_under, ended, failed_calls, settings,
                   unfinished_in)

KILLS, SIGNALS, PAIRS, EARLY = 200, 100, 10, 90


class Long:
    """A training of the same scene, long enough to be stopped many times."""

    def __init__(self, world, name, checkpoint_every, iterations=600):
        self.world, self.iterations = world, iterations
        self.run = world.path(name)
        self.arguments = ["train", world.scene, "-o", self.run, *settings(), "--set", f"train.iterations={iterations}",
                          "--set", f"train.checkpoint_every={checkpoint_every}"]
        shutil.rmtree(self.run, ignore_errors=True)
        outcome = world.run(self.arguments)
        if outcome.code != 0:
            raise SystemExit(f"without a fault the training must succeed: {outcome.err}")
        self.expected = self._left()
        self.start_fresh()

    def _left(self):
        left = self.world.left_in(self.run)
        with open(f"{self.run}/point_cloud/iteration_{self.iterations}/point_cloud.ply", "rb") as file:
            left["model"] = file.read()
        del left["config.toml"]  # differs in how often it saves
        return left

    def start_fresh(self):
        shutil.rmtree(self.run)

    def go_on(self):
        return self.world.start([*self.arguments, "--resume"])

    def finish(self):
        """Resumes to the end; returns the differences from an uninterrupted training."""
        outcome = self.world.run([*self.arguments, "--resume"])
        return self.errors_of(outcome)

    def errors_of(self, outcome):
        """Errors of a finished training; removes it."""
        wrong = complaints(outcome, (0,)) + [f"{path} was left behind" for path in unfinished_in(self.run)]
        if outcome.code == 0:
            left = self._left()
            wrong += [f"{name} is not as in a training that nothing disturbed" for name in left
                      if left[name] != self.expected[name]]
        self.start_fresh()
        return wrong


def killed_in_saving(world):
    """A checkpoint after each step. Every second kill is at a random time; the others wait for a new file."""
    long = Long(world, "kills", checkpoint_every=1)
    random.seed(1)
    kills = struck = 0
    while kills < KILLS:
        before = checkpoints_of(long.run)
        process = long.go_on()
        while process.poll() is None and checkpoints_of(long.run)[-1:] == before[-1:]:
            time.sleep(0.001)
        if kills % 2:
            time.sleep(random.uniform(0, 0.04))
        else:
            while process.poll() is None and not unfinished_in(long.run):
                pass
            time.sleep(random.uniform(0, 0.003))
        process.kill()
        outcome = ended(process)
        if outcome.code == 0:  # it finished first
            yield long.finish()
            continue
        wrong = [] if outcome.code == -signal.SIGKILL else [outcome.last_line()]
        wrong += [f"it warned: {line}" for line in outcome.warnings()]
        wrong += broken_checkpoints(long.run)
        after = checkpoints_of(long.run)
        if not after or (before and after[-1] < before[-1]):
            wrong.append(f"of checkpoints {before} there are {after}")
        kills, struck = kills + 1, struck + bool(unfinished_in(long.run))
        yield [f"kill {kills}: {what}" for what in wrong]
    few = f"{struck} of {KILLS} kills struck while a file was being written"
    yield long.finish() + ([few] if struck < KILLS // 10 else [])


class Replaced:
    """A run folder in which the training `command` is killed at one of its calls that change a file."""

    def __init__(self, world, name, prepare, command):
        self.world, self.prepare, self.command = world, prepare, command
        self.folder, self.report = world.path(name), world.path(name + ".report")
        self.run = self.folder + "/run"

    def fault(self, k, number, report):
        """Environment of a program that gets the signal at its k-th call; 0: counts only."""
        if os.path.exists(report):
            os.remove(report)
        return {"LD_PRELOAD": self.world.shims["fail_io"], "FAULT_FOLDER": self.folder, "FAULT_CALL": str(k),
                "FAULT_REPORT": report, "FAULT_KILL": str(int(number)), "FAULT_WHO": "first"}

    def begin(self):
        shutil.rmtree(self.folder, ignore_errors=True)
        os.makedirs(self.folder)
        self.prepare(self.run)

    def killed_at(self, k):
        """The call, and errors in how the program ended."""
        outcome = self.world.run(self.command(self.run), self.fault(k, signal.SIGKILL, self.report))
        failed, _ = failed_calls(self.report)
        where = f"killed at call {k} ({failed[0][1].replace(self.folder, '') if failed else 'none'})"
        return where, [] if outcome.code == -signal.SIGKILL else [outcome.last_line()]

    def moves(self):
        """Numbers of the calls that rename, remove or create; an error unless files of the previous run go."""
        self.begin()
        outcome = self.world.run(self.command(self.run), self.fault(0, signal.SIGKILL, self.report))
        _, calls = failed_calls(self.report)
        numbers = [k for k, what in calls if re.match("rename|unlink|remove|mkdir", what)]
        gone = len([what for k, what in calls if what.startswith(("unlink", "remove")) and ".part" not in what])
        return numbers, [] if outcome.code == 0 and gone > 4 else [f"{outcome.last_line()}, {gone} files removed"]

    def left_behind(self):
        return [f"{path} was left behind" for path in contents_under(self.run) if ".part" in path]


def has_begun(run):
    """Whether the folder is the next training's: from the rename to .begun on (optim/runs/replacement.hpp)."""
    with open(run + "/config.toml", encoding="utf-8") as file:
        return os.path.exists(run + "/.begun/config.toml") or "seed = 7" in file.read()


def replace_by_another(run):
    """Replaces world.whole by a training with another seed."""
    return lambda where: ["train", run, "-o", where, *settings(), "--set", "train.seed=7", "--overwrite"]


def killed_in_replacing(world):
    """Killed at each rename or removal while a training replaces another: for every later command the folder is
    complete, of the one or the other training, and can be resumed."""
    command, fresh = replace_by_another(world.scene), world.path("fresh")
    world.run(command(fresh))
    right = {False: world.expected, True: world.left_in(fresh)}
    replaced = Replaced(world, "replaced", lambda run: shutil.copytree(world.whole, run), command)
    numbers, wrong = replaced.moves()
    yield wrong
    both = set()
    for i, k in enumerate(numbers):
        replaced.begin()
        where, wrong = replaced.killed_at(k)
        run = replaced.run
        begun = has_begun(run)
        both.add(begun)
        reader = ([], ["info", run], ["eval", run, "--quiet"])[i % 3]
        if reader:  # a training that has started may have no model yet
            wrong += complaints(world.run(reader), (0, 1) if begun else (0,))
            left = world.left_in(run)
            wrong += [f"{name} is not as in the previous training after {reader[0]}" for name in left
                      if not begun and left[name] != right[False][name]]
        wrong += complaints(world.run(["train", "-o", run, "--resume", "--quiet"]), (0,))
        left = world.left_in(run)
        wrong += [f"{name} is not as in the {'next' if begun else 'previous'} training" for name in left
                  if left[name] != right[begun][name]]
        yield [f"{where}: {what}" for what in wrong + replaced.left_behind()]
    yield [] if len(both) == 2 else ["all kills were before the next had begun, or after"]


def killed_in_going_on(world):
    """The same while a resumed training sets the previous results aside; checks what is left."""
    def prepare(run):
        shutil.copytree(world.whole, run)
        for name in ("training.json", f"checkpoints/iteration_{checkpoints_of(run)[-1]}.npz"):
            os.remove(f"{run}/{name}")
    replaced = Replaced(world, "gone-on", prepare,
                        lambda run: ["train", world.scene, "-o", run, *settings(), "--resume"])
    numbers, wrong = replaced.moves()
    yield wrong
    for k in numbers:
        replaced.begin()
        where, wrong = replaced.killed_at(k)
        wrong += complaints(world.run(["eval", replaced.run, "--quiet"]), (0,))
        wrong += complaints(world.run(["train", "-o", replaced.run, "--resume", "--quiet"]), (0,))
        wrong += world.differences(replaced.run) + replaced.left_behind()
        yield [f"{where}: {what}" for what in wrong]


def killed_beside_another(world):
    """A second training that must not replace the first has found the folder complete and waits. Meanwhile the
    training that replaces it is killed."""
    replaced = Replaced(world, "beside", lambda run: shutil.copytree(world.whole, run),
                        replace_by_another(world.scene))
    numbers, wrong = replaced.moves()
    yield wrong
    for k in numbers[::4]:
        replaced.begin()
        waiting = world.start(["train", world.scene, "-o", replaced.run, *settings()],
                              replaced.fault(1, signal.SIGSTOP, replaced.report + ".waiting"))
        while waiting.poll() is None and state_of(waiting.pid) != "T":
            time.sleep(0.001)
        where, wrong = replaced.killed_at(k)
        waiting.send_signal(signal.SIGCONT)
        begun = has_begun(replaced.run)
        outcome = ended(waiting)
        if not begun:
            wrong += complaints(outcome, (1,), ["contains a finished run"]) + world.differences(replaced.run)
        yield [f"{where}: {what}" for what in wrong]


def state_of(pid):
    with open(f"/proc/{pid}/stat", encoding="ascii", errors="replace") as file:
        return file.read().rpartition(")")[2].split()[0]


def handles(pid, number):
    try:
        for line in open(f"/proc/{pid}/status", encoding="ascii"):
            if line.startswith("SigCgt:"):
                return int(line[7:], 16) >> (number - 1) & 1
    except OSError:
        pass
    return 0


def signalled(world):
    """A signal at any moment after the program has started; each tenth time a second one. Every fifth training
    is resumed to its end."""
    long = Long(world, "signals", checkpoint_every=100)
    random.seed(2)
    late = 0
    for trial in range(SIGNALS):
        number = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)[trial % 3]
        process = long.go_on()
        while process.poll() is None and not handles(process.pid, number):
            time.sleep(0.001)
        time.sleep(random.uniform(0, 1.2))
        process.send_signal(number)
        if trial % 10 == 9:
            time.sleep(random.uniform(0, 0.01))
            process.send_signal(number)
        outcome = ended(process)
        late += outcome.code == 0
        wrong = complaints(outcome, (0, 128 + number), ["interrupted"])
        wrong += [f"{path} was left behind" for path in unfinished_in(long.run)]
        wrong += broken_checkpoints(long.run)
        if trial % 5 == 4 or outcome.code == 0:
            wrong += long.finish()
        yield [f"{signal.Signals(number).name} {trial + 1}: {what}" for what in wrong]
    yield [f"{late} of {SIGNALS} signals came too late"] if 2 * late > SIGNALS else []


def early(world):
    """A signal before the program has its handlers, or while it parses its command line: it dies of it or reports
    it, and leaves no new or incomplete file."""
    still, out = world.path("early.splat"), world.path("early")
    world.run(["export", world.whole, "-o", still, "--quiet"])
    random.seed(4)
    late = 0
    for trial in range(EARLY):
        shutil.rmtree(out, ignore_errors=True)
        os.makedirs(out)
        arguments = (["import", still, "-o", out + "/out.ply"], ["export", world.whole, "-o", out + "/out.splat"],
                     ["render", world.whole, "-o", out + "/images"], ["eval", world.whole, "--quiet"], ["devices"],
                     ["train", world.scene, "-o", out + "/run", *settings()])[trial % 6]
        number = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)[trial // 6 % 3]
        process = world.start(arguments)
        time.sleep(random.uniform(0, 0.5) if trial % 2 else random.uniform(0, 0.05))
        process.send_signal(number)
        outcome = ended(process)
        late += outcome.code == 0
        wrong = [] if outcome.code == -number and not outcome.err else complaints(
            outcome, (0, 128 + number), ["interrupted"])
        wrong += [f"{path} was left behind" for path in unfinished_in(out) + unfinished_in(world.whole)]
        wrong += broken_checkpoints(out + "/run")
        yield [f"{arguments[0]}, {signal.Signals(number).name} {trial + 1}: {what}" for what in wrong]
    yield [f"{late} of {EARLY} signals came too late"] if 2 * late > EARLY else []
    wrong = world.differences(world.whole)  # written by the interrupted eval
    yield [f"eval: {what}" for what in wrong]


def ignored(world):
    """As under nohup: a signal ignored at the start stays ignored, also when drivers have replaced the handlers."""
    for number in (signal.SIGHUP, signal.SIGINT):
        run = world.path("ignored")
        shutil.rmtree(run, ignore_errors=True)
        process = world.start(["train", world.scene, "-o", run, *settings(), "--set", "train.iterations=200"],
                              ignored=(number,))
        while process.poll() is None and not checkpoints_of(run):  # training, with handlers that save
            time.sleep(0.001)
        process.send_signal(number)
        outcome = ended(process)
        late = [] if checkpoints_of(run) else ["it was not under way when the signal came"]
        yield [f"{signal.Signals(number).name}: {what}" for what in complaints(outcome, (0,)) + late]


def two_in_one_folder(world):
    """The second process is rejected with the process id of the first, which is not affected."""
    results = []
    long = Long(world, "pairs", checkpoint_every=20, iterations=300)
    for trial in range(PAIRS):
        first = long.go_on()
        while first.poll() is None and not checkpoints_of(long.run):
            time.sleep(0.005)
        first.send_signal(signal.SIGSTOP)  # it must still run when the last of the others starts
        wrong = []
        for more in ([], ["--resume"], ["--overwrite"]):
            second = world.run([*long.arguments, *more])
            wrong += complaints(second, (1,), [f"written by process {first.pid}"])
        beside = world.run(["info", long.run])
        wrong += complaints(beside, (0,))
        first.send_signal(signal.SIGCONT)
        outcome = ended(first)
        wrong += complaints(outcome, (0,)) + long.finish()
        results.append([f"pair {trial + 1}: {what}" for what in wrong])
    for trial in range(PAIRS):  # simultaneous start
        run = world.path("race")
        shutil.rmtree(run, ignore_errors=True)
        both = [world.start(["train", world.scene, "-o", run, *settings()]) for _ in range(2)]
        outcomes = sorted((ended(process) for process in both), key=lambda outcome: str(outcome.code))
        wrong = complaints(outcomes[0], (0,)) + world.differences(run)
        wrong += complaints(outcomes[1], (1,), [("being written by", "contains a finished run", "not empty")])
        results.append([f"race {trial + 1}: {what}" for what in wrong])
    return results


def side_by_side(world):
    """Two trainings of 2000 steps at the same time, in separate folders: each has the bytes of one alone."""
    long = Long(world, "beside", checkpoint_every=500, iterations=2000)
    runs = [world.path("beside-first"), world.path("beside-second")]
    both = [world.start([run if word == long.run else word for word in long.arguments]) for run in runs]
    for run, process in zip(runs, both):
        outcome = ended(process)
        if outcome.code == 0:
            os.rename(run, long.run)
        wrong = long.errors_of(outcome) if outcome.code == 0 else [outcome.last_line()]
        yield [f"{os.path.basename(run)}: {what}" for what in wrong]


def faults(world, every):
    yield f"stops: kill -9 while saving, {KILLS} times", lambda: killed_in_saving(world)
    yield "stops: kill -9 at each file of a training that replaces another", lambda: killed_in_replacing(world)
    yield "stops: kill -9 where a training that goes on puts results aside", lambda: killed_in_going_on(world)
    yield "stops: kill -9 beside another training that waits", lambda: killed_beside_another(world)
    yield f"stops: SIGINT, SIGTERM, SIGHUP at {SIGNALS} moments", lambda: signalled(world)
    yield "stops: signals in the first half second", lambda: early(world)
    yield "stops: signals that are ignored (nohup)", lambda: ignored(world)
    yield "stops: two processes in one folder", lambda: two_in_one_folder(world)
    yield "stops: two trainings side by side", lambda: side_by_side(world)
