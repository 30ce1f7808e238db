"""Commands other than training, interrupted at any moment: expects the right exit code, one sentence, old or new
results, and no process left."""
import os
import random
import shutil
import signal
import time

from outputs import others, replaces
from stops import handles
from world import complaints, contents_under, ended, unfinished_in

MOMENTS = 21


def working_in(folder):
    """Processes whose command line contains the folder or that run in it."""
    found = []
    for pid in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open(f"/proc/{pid}/cmdline", encoding="utf-8", errors="replace") as file:
                line = file.read().replace("\0", " ")
            if folder in line or os.readlink(f"/proc/{pid}/cwd").startswith(folder):
                found.append(f"{pid}: {line}")
        except OSError:
            pass
    return found


def interrupted(trial):
    world, folder = trial.world, trial.world.path(trial.name + "-interrupted")

    def begin():
        shutil.rmtree(folder, ignore_errors=True)
        os.makedirs(folder)
        trial.prepare(folder)
        return contents_under(folder), world.start(trial.arguments(folder))

    _, process = begin()
    start = time.monotonic()
    outcome = ended(process)
    takes = time.monotonic() - start
    if outcome.code != 0:
        yield [f"without a signal: {outcome.last_line()}"]
        return
    trial.right = contents_under(folder)
    random.seed(5)
    late = 0
    for moment in range(MOMENTS):
        number = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)[moment % 3]
        before, process = begin()
        while process.poll() is None and not handles(process.pid, number):
            time.sleep(0.001)
        time.sleep(0.8 * takes * (moment + random.random()) / MOMENTS)
        process.send_signal(number)
        outcome = ended(process)
        late += outcome.code == 0
        wrong = complaints(outcome, (0, 128 + number), [("interrupted", "stopped with")])
        wrong += [f"it works on: {who}" for who in working_in(folder)]
        wrong += [f"{path} was left behind" for path in unfinished_in(folder)]
        wrong += trial.check(folder, outcome, before)
        shutil.rmtree(folder, ignore_errors=True)
        yield [f"{signal.Signals(number).name} at moment {moment + 1}: {what}" for what in wrong]
    yield [f"{late} of {MOMENTS} signals came too late"] if 4 * late > 3 * MOMENTS else []


def faults(world, every):
    output = lambda *words: lambda folder: [*words, "-o", folder + "/out", "--quiet"]
    trials = {trial.name: trial for trial in others(world)}
    trials["render"] = replaces(world, "render", lambda folder: None, output("render", world.whole, "--camera", "cam01",
                                                                             "--times", "0:1:20"))
    trials["export"] = replaces(world, "export", lambda folder: None, lambda folder: [
        "export", world.whole, "-o", folder + "/out.4dgs", "--steps", "40", "--quiet"], old=("out.4dgs",))
    for name in ("render", "eval", "export", "ply-sequence", "splat", "stress", "bench", "experiment"):
        yield f"interrupts: {name} at {MOMENTS} moments", lambda name=name: interrupted(trials[name])
