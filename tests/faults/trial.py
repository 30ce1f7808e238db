"""A command with one disk fault: the k-th call that changes or reads a file fails."""
import errno
import os
import re
import shutil
from concurrent.futures import ThreadPoolExecutor

from world import complaints, contents_under, failed_calls, unfinished_in

REASONS = {errno.ENOSPC: "No space left on device", errno.EIO: "Input/output error",
           errno.EROFS: "Read-only file system"}
FOREVER = 10**9
# Files whose failed writes must not stop a training. (A rename to metrics.jsonl happens before its start.)
GOES_ON = re.compile(r"(?!rename ).*/(metrics\.(jsonl|csv)$|\.?iteration_[48]\.)")


def worth_failing(calls):
    """The calls to fail: all, except that of consecutive fwrites or reads of one file only the first, the last and
    every fortieth are used."""
    chosen = []
    for i, (number, what) in enumerate(calls):
        first = i == 0 or calls[i - 1][1] != what
        last = i + 1 == len(calls) or calls[i + 1][1] != what
        if not what.startswith(("fwrite ", "fread ", "read ")) or first or last or number % 40 == 0:
            chosen.append(number)
    return chosen


def tell_if_fewer(numbers, calls):
    if len(numbers) < len(calls):
        print(f"    {len(numbers)} of {len(calls)} calls", flush=True)


class Trial:
    """One command with one fault. prepare(folder) creates the initial files; arguments(folder) is the command;
    check(folder, outcome, before) returns the errors afterwards. reads: calls that read fail instead of those
    that change; who: FAULT_WHO of fail_io.c. right: contents of the folder without a fault."""

    def __init__(self, world, name, prepare, arguments, check, reads=False, who=""):
        self.world, self.name, self.reads, self.who = world, name, reads, who
        self.prepare, self.arguments, self.check = prepare, arguments, check
        self.right = {}
        self.varies = False  # the number of calls depends on the clock
        self.missed = 0  # faults that did not occur because of that
        self.room = False  # calls fail until a file is removed

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
            "FAULT_LAST": str(last), "FAULT_ERRNO": str(code), "FAULT_REPORT": report,
            "FAULT_READS": str(int(self.reads)), "FAULT_ROOM": str(int(self.room)), **({"FAULT_WHO": self.who} if self.who else {})})
        failed, calls = failed_calls(report)
        if first == 0:
            self.right = contents_under(folder)
            return outcome, calls, folder
        where = f"{os.strerror(code)} at call {first}{'' if first == last else ' and all later'}"
        if not failed:
            shutil.rmtree(folder)
            self.missed += 1
            return [] if self.varies else [f"{where}: the fault did not strike"]
        where += " (" + failed[0][1].replace(folder, "") + ")"
        wrong = complaints(outcome, (0, 1), self.needles(failed, folder, code))
        if not self.reads:
            wrong += [f"{line!r} does not say why" for line in outcome.warnings() if REASONS[code] not in line]
        wrong += [f"{path} was left behind" for path in unfinished_in(folder)]
        wrong += self.check(folder, outcome, before)
        if not self.reads and outcome.code and first == last and GOES_ON.match(failed[0][1]):
            wrong.append(f"training stops, and could go on: {outcome.last_line()}")
        shutil.rmtree(folder, ignore_errors=True)
        return [f"{where}: {what}" for what in wrong]

    def needles(self, failed, folder, code):
        """What the error message must contain."""
        if self.reads:
            return [tuple(os.path.basename(what) for _, what in failed)]
        # FFmpeg writes videos and gnuplot writes plots; neither reports why a write failed.
        words = {".mp4": "FFmpeg did not write all of it", ".svg": "gnuplot left it incomplete",
                 ".png": "gnuplot left it incomplete"}
        other = words.get(os.path.splitext(failed[0][1])[1]) if self.who == "gnuplot" or (
            failed[0][1].endswith(".mp4")) else None
        return [(REASONS[code], other) if other else REASONS[code], folder]


def every_call(trial, every):
    """Fails each call alone, and each third one (`every`: each) together with all later ones."""
    outcome, calls, folder = trial.run(0, 0, 0, "clean")
    if outcome.code != 0 or not calls:
        yield [f"without a fault: {outcome.last_line()}, {len(calls)} calls"]
        return
    shutil.rmtree(folder)
    numbers = [n for n, _ in calls] if every else worth_failing(calls)
    tell_if_fewer(numbers, calls)
    codes = [errno.EIO] if trial.reads else list(REASONS)
    jobs = []
    for i, k in enumerate(numbers):
        for code in codes if every else [codes[i % len(codes)]]:
            jobs.append((k, k, code))
        if every or i % 3 == 0:
            jobs.append((k, FOREVER, codes[i // 3 % len(codes)]))
    with ThreadPoolExecutor(2) as pool:
        yield from pool.map(lambda job: trial.run(*job[1], job[0]), enumerate(jobs))
    if 2 * trial.missed > len(jobs):
        yield [f"{trial.missed} of {len(jobs)} faults did not strike"]


def chosen_calls(trial, word, most):
    """Fails the first calls on files whose name contains the word."""
    outcome, calls, folder = trial.run(0, 0, 0, "clean")
    shutil.rmtree(folder)
    numbers = [n for n, what in calls if word in what][:most]
    if outcome.code != 0 or not numbers:
        return [[f"without a fault: {outcome.last_line()}, no file has {word!r}"]]
    return [trial.run(k, k, errno.ENOSPC, str(k)) for k in numbers]


def from_some_on(trial, count):
    """Fails some calls, spread over all, each together with all later ones."""
    outcome, calls, folder = trial.run(0, 0, 0, "clean")
    shutil.rmtree(folder)
    if outcome.code != 0 or not calls:
        return [[f"without a fault: {outcome.last_line()}, {len(calls)} calls"]]
    numbers = sorted({calls[i * (len(calls) - 1) // (count - 1)][0] for i in range(count)})
    return [trial.run(k, FOREVER, errno.ENOSPC, str(k)) for k in numbers]
