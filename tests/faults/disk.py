"""Disk faults: the k-th call that changes a file fails, once or from then on."""
import errno
import os
import re
import shutil

from outputs import gnuplot, is_whole_video, others
from surroundings import as_always
from trial import FOREVER, Trial, every_call, from_some_on
from world import broken_checkpoints, checkpoints_of, contents_under, settings


def training(world, name, prepare, arguments):
    """A training that must equal an undisturbed one, directly or after a resume."""
    def check(folder, outcome, before):
        run = folder + "/run"
        wrong = broken_checkpoints(run)
        had = [step for step in (4, 8, 10) if f"run/checkpoints/iteration_{step}.npz" in before]
        if had and not any(step >= had[-1] for step in checkpoints_of(run)):
            wrong.append("the checkpoint there was is gone")
        # A log line that did not fit on the disk is not written later.
        lost = ("metrics.jsonl", "metrics.csv") if any("metrics of step" in line for line in outcome.warnings()) else ()
        wrong += world.differences(run, lost) if outcome.code == 0 else []
        return wrong + world.resumed_as_undisturbed(run, lost)
    return Trial(world, name, prepare, arguments, check)


def full_at_the_end(world):
    """The disk is full from some final write on until something is removed: removing the second-last checkpoint
    frees space, and nothing is lost. (Once the last one is written, the one before it is gone.)"""
    trial = training(world, "train until there is room", lambda folder: None,
                     lambda folder: ["train", world.scene, "-o", folder + "/run", *settings()])
    as_ever = trial.check

    def check(folder, outcome, before):
        wrong = [] if outcome.code == 0 else [outcome.last_line()]
        if "deleted older checkpoints to free space (step 4), kept that of step 8" not in outcome.err:
            wrong.append(f"it does not say what made room: {outcome.err.strip()!r}")
        return wrong + as_ever(folder, outcome, before)
    trial.check, trial.room = check, True
    outcome, calls, folder = trial.run(0, 0, 0, "clean")
    shutil.rmtree(folder)
    if outcome.code != 0:
        yield [f"without a fault: {outcome.last_line()}"]
        return
    of_end = re.compile(r"(open|write|fsync|rename) .*/(\.?training[.0-9]|checkpoints/\.?iteration_10\.)")
    numbers = [number for number, what in calls if of_end.match(what)]
    if len(numbers) < 9:
        yield [f"only {len(numbers)} calls write the end"]
    yield from (trial.run(k, FOREVER, errno.ENOSPC, str(k)) for k in numbers)


def one_output(world, name, arguments, output):
    """A command that replaces the file `output`, which must be the old or the new one."""
    def prepare(folder):
        with open(os.path.join(folder, output), "wb") as file:
            file.write(b"the file that was there before")

    def check(folder, outcome, before):
        now = contents_under(folder)
        right = trial.right if outcome.code == 0 else before
        return [] if now == right else [f"{output} is neither the old nor the new one: {sorted(now)}"]
    trial = Trial(world, name, prepare, arguments, check)
    return trial


def images(world):
    """Rendering: the files that exist equal those of an undisturbed rendering. Videos may use another encoder,
    which is tried if the first cannot start."""
    command = lambda folder: ["render", world.whole, "-o", folder + "/out", "--quiet"]

    def check(folder, outcome, before):
        now, whole = contents_under(folder), trial.right
        wrong = [f"{name} is there and not whole" for name in now if now[name] != whole.get(name)
                 and not (name.endswith(".mp4") and is_whole_video(now[name]))]
        if outcome.code == 0 and sorted(now) != sorted(whole):
            wrong.append(f"it succeeds without {sorted(set(whole) - set(now))}")
        return wrong
    trial = Trial(world, "render", lambda folder: None, command, check)
    return trial


def stopped_before(world):
    return lambda folder: shutil.copytree(world.stopped, folder + "/run")


def replacing(world):
    """A training that replaces another. If it fails, either the previous run is complete or the folder is its own."""
    command = lambda folder: ["train", world.scene, "-o", folder + "/run", *settings(), "--set", "train.seed=7",
                              "--overwrite"]

    def check(folder, outcome, before):
        now = contents_under(folder)
        begun = "run/.begun/config.toml" in now or b"seed = 7" in now.get("run/config.toml", b"")
        wrong = []
        changed = [name for name in before if now.get(name) != before[name] and not name.endswith(".lock")]
        if changed and not begun:
            wrong.append(f"neither the previous run nor the next: {changed}")
        if "is unchanged" in outcome.err and changed:
            wrong.append(f"it says that the previous run is unchanged, but {changed} are not")
        if outcome.code == 0 and not (begun and "run/results.json" in now):
            wrong.append("it succeeds and is not there")
        return wrong
    return Trial(world, "replace", lambda folder: shutil.copytree(world.whole, folder + "/run"), command, check)


def over_and_over(world):
    """A finished training that is resumed: its model and results stay, whatever fails."""
    def prepare(folder):
        shutil.copytree(world.whole, folder + "/run")
        for name in ("results_train.json", "per_view_iteration_4.json"):
            with open(f"{folder}/run/{name}", "w", encoding="utf-8") as file:
                file.write("{}")

    def check(folder, outcome, before):
        now = contents_under(folder)
        return [f"{name} is gone or another" for name in before if name != "run/.lock" and now.get(name) != before[name]]
    return Trial(world, "resume what is over", prepare,
                 lambda folder: ["train", "-o", folder + "/run", "--resume", "--quiet"], check)


def trials(world):
    """All commands that write files, by name."""
    train = lambda folder: ["train", world.scene, "-o", folder + "/run", *settings()]
    resume = lambda folder: [*train(folder), "--resume"]
    made = [training(world, "train", lambda folder: None, train),
            training(world, "resume", stopped_before(world), resume), replacing(world), over_and_over(world),
            images(world)]
    for name in ("out.ply", "out.splat", "out.splatv", "out.4dgs"):
        export = lambda folder, name=name: ["export", world.whole, "-o", f"{folder}/{name}", "--quiet"]
        made.append(one_output(world, "export " + name[3:], export, name))
    still = world.path("still.splat")
    world.run(["export", world.whole, "-o", still, "--quiet"])
    made.append(one_output(world, "import", lambda folder: ["import", still, "-o", folder + "/out.ply", "--quiet"],
                           "out.ply"))
    made += others(world)
    return {trial.name: trial for trial in made}


def in_parts(world):
    """Every call writes or reads less than requested, as on a slow or nearly full disk."""
    run, report = world.path("in parts"), world.path("parts.report")
    wrong = as_always(world, "in parts", {"LD_PRELOAD": world.shims["fail_io"], "FAULT_FOLDER": run, "FAULT_PARTS": "1",
                                          "FAULT_REPORT": report}, run)
    with open(report, encoding="utf-8", errors="surrogateescape") as file:
        parted = {tuple(line.split()[1:3]) for line in file}
    missed = [call for call in ("write", "read") if ("parted", call) not in parted]
    return [wrong + [f"no call of {call} was cut short" for call in missed]]


def faults(world, every):
    for name, trial in trials(world).items():
        yield f"disk: every write of {name}", lambda trial=trial: every_call(trial, every)
    yield "disk: all is written and read in parts", lambda: in_parts(world)
    yield "disk: full when gnuplot draws", lambda: from_some_on(gnuplot(world), 6)
    yield "disk: full when a training ends, until something is removed", lambda: full_at_the_end(world)
