"""The disk: the k-th call that changes a file fails, once or from then on."""
import errno
import os
import re
import shutil
from concurrent.futures import ThreadPoolExecutor

from world import broken_checkpoints, checkpoints_of, complaints, contents_under, failed_calls, settings, unfinished_in

REASONS = {errno.ENOSPC: "No space left on device", errno.EIO: "Input/output error",
           errno.EROFS: "Read-only file system"}
FOREVER = 10**9
# What no training may be stopped by: there may be room later. (A rename to metrics.jsonl is of before its start.)
GOES_ON = re.compile(r"(?!rename ).*/(metrics\.(jsonl|csv)$|\.?iteration_[48]\.)")


def worth_failing(calls):
    """The calls to let fail: all, but of a row of fwrites to one file, which differ in nothing, the first, the
    last and every fortieth."""
    chosen = []
    for i, (number, what) in enumerate(calls):
        first = i == 0 or calls[i - 1][1] != what
        last = i + 1 == len(calls) or calls[i + 1][1] != what
        if not what.startswith("fwrite ") or first or last or number % 40 == 0:
            chosen.append(number)
    return chosen


class Trial:
    """One command with one fault. prepare(folder) makes what is there before; arguments(folder) the command;
    check(folder, outcome, before) tells what is wrong afterwards."""

    def __init__(self, world, name, prepare, arguments, check):
        self.world, self.name = world, name
        self.prepare, self.arguments, self.check = prepare, arguments, check

    def run(self, first, last, code, tag):
        folder = self.world.path(f"{self.name}-{tag}")
        shutil.rmtree(folder, ignore_errors=True)
        os.makedirs(folder)
        self.prepare(folder)
        before = contents_under(folder)
        report = folder + ".report"
        if os.path.exists(report):
            os.remove(report)
        outcome = self.world.run(self.arguments(folder), {
            "LD_PRELOAD": self.world.shims["fail_io"], "FAULT_FOLDER": folder, "FAULT_CALL": str(first),
            "FAULT_LAST": str(last), "FAULT_ERRNO": str(code), "FAULT_REPORT": report})
        failed, calls = failed_calls(report)
        if first == 0:
            return outcome, calls, folder
        # FFmpeg writes videos, and tells nobody why it could not.
        video = failed and failed[0][1].endswith(".mp4")
        reason = (REASONS[code], "FFmpeg did not write all of it") if video else REASONS[code]
        wrong = complaints(outcome, (0, 1), [reason, folder])
        wrong += [f"{line!r} does not say why" for line in outcome.warnings() if REASONS[code] not in line]
        wrong += [f"{path} was left behind" for path in unfinished_in(folder)]
        wrong += self.check(folder, outcome, before)
        shutil.rmtree(folder, ignore_errors=True)
        where = f"{os.strerror(code)} at call {first}{'' if first == last else ' and all later'}"
        if not failed:
            return [f"{where}: the fault did not strike"]
        if outcome.code and first == last and GOES_ON.match(failed[0][1]):
            wrong.append(f"training stops, and could go on: {outcome.last_line()}")
        where += " (" + failed[0][1].replace(folder, "") + ")"
        return [f"{where}: {what}" for what in wrong]


def every_call(trial, every):
    """Lets each call fail alone, and each third one (`every`: each) with all later ones."""
    outcome, calls, folder = trial.run(0, 0, 0, "clean")
    if outcome.code != 0 or not calls:
        yield [f"without a fault: {outcome.last_line()}, {len(calls)} calls"]
        return
    shutil.rmtree(folder)
    numbers = [n for n, _ in calls] if every else worth_failing(calls)
    codes = list(REASONS)
    jobs = []
    for i, k in enumerate(numbers):
        for code in codes if every else [codes[i % 3]]:
            jobs.append((k, k, code))
        if every or i % 3 == 0:
            jobs.append((k, FOREVER, codes[i // 3 % 3]))
    with ThreadPoolExecutor(2) as pool:
        yield from pool.map(lambda job: trial.run(*job[1], job[0]), enumerate(jobs))


def chosen_calls(trial, word, most):
    """Lets the first calls fail whose file has this word."""
    outcome, calls, folder = trial.run(0, 0, 0, "clean")
    shutil.rmtree(folder)
    numbers = [n for n, what in calls if word in what][:most]
    if outcome.code != 0 or not numbers:
        return [[f"without a fault: {outcome.last_line()}, no file has {word!r}"]]
    return [trial.run(k, k, errno.ENOSPC, str(k)) for k in numbers]


def training(world, name, prepare, arguments):
    """A training that is to be as an undisturbed one, at once or when it is resumed."""
    def check(folder, outcome, before):
        run = folder + "/run"
        wrong = broken_checkpoints(run)
        had = [step for step in (4, 8, 10) if f"run/checkpoints/iteration_{step}.npz" in before]
        if had and not any(step >= had[-1] for step in checkpoints_of(run)):
            wrong.append("the checkpoint there was is gone")
        # A line of the log for which there was no room is not written later.
        lost = ("metrics.jsonl", "metrics.csv") if any("no metrics of" in line for line in outcome.warnings()) else ()
        wrong += world.differences(run, lost) if outcome.code == 0 else []
        return wrong + world.resumed_as_undisturbed(run, lost)
    return Trial(world, name, prepare, arguments, check)


def one_output(world, name, arguments, output):
    """A command that replaces `output`, a file: it is the old one or the new one."""
    new = {}

    def prepare(folder):
        with open(os.path.join(folder, output), "wb") as file:
            file.write(b"the file that was there before")

    def check(folder, outcome, before):
        now = contents_under(folder)
        if not new:
            assert world.run(arguments(folder)).code == 0
            new.update(contents_under(folder))
        right = new if outcome.code == 0 else before
        return [] if now == right else [f"{output} is neither the old nor the new one: {sorted(now)}"]
    return Trial(world, name, prepare, arguments, check)


def is_whole_video(content):
    """Whether its boxes (length, name, contents) end where the file does, with an index among them."""
    at, names = 0, []
    while at + 8 <= len(content):
        length = int.from_bytes(content[at:at + 4], "big")
        names.append(content[at + 4:at + 8])
        if length < 8:
            return False
        at += length
    return at == len(content) and b"moov" in names


def pictures(world):
    """Rendering: the files that are there are those of an undisturbed rendering; videos may be by another
    encoder, which is tried where the first cannot begin."""
    reference = world.path("pictures")
    command = lambda folder: ["render", world.whole, "-o", folder + "/out", "--quiet"]
    whole = {}

    def check(folder, outcome, before):
        if not whole:
            assert world.run(["render", world.whole, "-o", reference, "--quiet"]).code == 0
            whole.update(contents_under(reference))
        now = contents_under(folder + "/out")
        wrong = [f"{name} is there and not whole" for name in now if now[name] != whole.get(name)
                 and not (name.endswith(".mp4") and is_whole_video(now[name]))]
        if outcome.code == 0 and sorted(now) != sorted(whole):
            wrong.append(f"it succeeds without {sorted(set(whole) - set(now))}")
        return wrong
    return Trial(world, "render", lambda folder: None, command, check)


def stopped_before(world):
    return lambda folder: shutil.copytree(world.stopped, folder + "/run")


def trials(world):
    """All commands that write, by name."""
    train = lambda folder: ["train", world.scene, "-o", folder + "/run", *settings()]
    resume = lambda folder: [*train(folder), "--resume"]
    made = [training(world, "train", lambda folder: None, train),
            training(world, "resume", stopped_before(world), resume), pictures(world)]
    for name in ("out.ply", "out.splat", "out.splatv", "out.4dgs"):
        export = lambda folder, name=name: ["export", world.whole, "-o", f"{folder}/{name}", "--quiet"]
        made.append(one_output(world, "export " + name[3:], export, name))
    still = world.path("still.splat")
    world.run(["export", world.whole, "-o", still, "--quiet"])
    made.append(one_output(world, "import", lambda folder: ["import", still, "-o", folder + "/out.ply", "--quiet"],
                           "out.ply"))
    return {trial.name: trial for trial in made}


def faults(world, every):
    for name, trial in trials(world).items():
        yield f"disk: every write of {name}", lambda trial=trial: every_call(trial, every)
