"""Commands other than training that write results, and checks of the files that a failing disk leaves."""
import json
import os
import re
import shutil

from trial import Trial
from world import ROOT, SETTINGS, complaints, contents_under

PLAN = """title = "Faults"
scenes = [{{ path = "{scene}", name = "demo" }}]
seeds = [0, 1]
metrics = ["psnr", "minutes"]
[settings]
{settings}
"""

# An interrupted training keeps a checkpoint of that moment in place of another.
EARLIER = re.compile(r"/checkpoints/iteration_[1-9]\.")


def is_whole_video(content):
    """Whether the boxes (length, name, contents) end with the file and include an index."""
    at, names = 0, []
    while at + 8 <= len(content):
        length = int.from_bytes(content[at:at + 4], "big")
        names.append(content[at + 4:at + 8])
        if length < 8:
            return False
        at += length
    return at == len(content) and b"moov" in names


def is_whole(path, new, right):
    """Whether a file that contains times, which differ between runs, has its last line and all its lines."""
    if path.endswith(".json"):
        return json.loads(new).keys() == json.loads(right).keys()
    if path.endswith(".svg"):
        return new.rstrip().endswith(b"</svg>")
    if path.endswith(".png"):
        return new.endswith(b"IEND\xaeB`\x82")
    return new.endswith(b"\n") and new.count(b"\n") == right.count(b"\n")


def replaces(world, name, prepare, arguments, timed=(), who="", old=(), reads=False, free=None, again=True):
    """A command that writes files, each of which must be the old or the new one; with `again`, the same command
    succeeds afterwards. timed: parts of names of files that contain times; old: names of files that are replaced;
    free: part of names of files that need to be complete only at the end."""
    def prepare_all(folder):
        prepare(folder)
        for path in old:
            os.makedirs(os.path.dirname(os.path.join(folder, path)), exist_ok=True)
            with open(os.path.join(folder, path), "wb") as file:
                file.write(b"the file that was there before")

    def is_new(path, now, done):
        right = trial.right.get(path)
        if os.path.basename(path) == ".lock" or EARLIER.search(path):  # contains a process id
            return True
        if free and free in path and not (done and path.endswith((".ply", ".png", ".toml"))):
            return not done or right is not None
        if right is None or now == right:
            return now == right
        # If a side is not a multiple of 16, x264 encodes uninitialised padding: other bytes, the same images.
        if path.endswith(".mp4"):
            return is_whole_video(now)
        try:
            return any(word in path for word in timed) and is_whole(path, now, right)
        except ValueError:
            return False

    def differences(folder, before, done):
        now = contents_under(folder)
        wrong = [f"{path} is gone" for path in before if path not in now]
        for path in now:
            if not is_new(path, now[path], done) and (done or now[path] != before.get(path)):
                wrong.append(f"{path} is neither the old nor the new one" if path in trial.right and not done else
                             f"{path} is not as without the fault")
        missing = [path for path in trial.right if done and path not in now and not EARLIER.search(path)]
        return wrong + ([f"there is no {', '.join(missing[:3])} ({len(missing)} in all)"] if missing else [])

    def check(folder, outcome, before):
        wrong = differences(folder, before, outcome.code == 0)
        if outcome.code != 0 and again:
            then = world.run(arguments(folder))
            wrong += [f"then: {what}" for what in complaints(then, (0,)) + differences(folder, {}, True)]
        return wrong

    trial = Trial(world, name, prepare_all, arguments, check, reads, who)
    trial.varies = reads and name == "experiment" or who == "gnuplot"  # polls its runs until they end; plots times
    return trial


def with_old_results(world):
    def prepare(folder):
        shutil.copytree(world.whole, folder + "/run")
        for name in ("results.json", "per_view.json"):  # as written by another version
            path = f"{folder}/run/{name}"
            with open(path, encoding="utf-8") as file:
                results = json.load(file)
            (results if isinstance(results, dict) else results[0])["psnr"] = 1
            with open(path, "w", encoding="utf-8") as file:
                json.dump(results, file)
    return prepare


def write_plan(world, path):
    with open(path, "w", encoding="utf-8") as file:
        file.write(PLAN.format(scene=world.scene, settings="\n".join(
            setting.replace("=", " = ", 1) for setting in SETTINGS)))


def half_an_experiment(world):
    """One of two trainings is finished, and its table exists."""
    base = world.path("half")

    def prepare(folder):
        if not os.path.isdir(base):
            os.makedirs(base)
            write_plan(world, base + "/plan.toml")
            outcome = world.run(experiment(base))
            if outcome.code != 0:
                raise SystemExit(f"without a fault the experiment must succeed: {outcome.err}")
            for name in os.listdir(base + "/out/runs"):
                if "seed1" in name:
                    path = f"{base}/out/runs/{name}"
                    shutil.rmtree(path) if os.path.isdir(path) else os.remove(path)
        shutil.copytree(base, folder, dirs_exist_ok=True)
    return prepare


def experiment(folder):
    return ["experiment", folder + "/plan.toml", "-o", folder + "/out", "--quiet"]


def raster(folder):
    return ["bench", "raster", "--pixels", "16x16", "--gaussians", "100", "--repeats", "1", "--json",
            folder + "/out.json", "--plots", folder + "/plots", "--quiet"]


TIMED_OF_EXPERIMENT = ("costs.md", "runs.csv", "table.", "plots/")
OLD_PLOTS = tuple("plots/raster." + ending for ending in ("tsv", "gnuplot", "svg", "png"))


def others(world):
    """Commands that write files, except train, render, import and exports of a single file."""
    splat = os.path.join(ROOT, "tests/data/oracle/small_paper.npz")
    nothing = lambda folder: None
    return [
        replaces(world, "eval", with_old_results(world), lambda folder: ["eval", folder + "/run", "--quiet"],
                 ("results.json",)),
        replaces(world, "ply-sequence", nothing,
                 lambda folder: ["export", world.whole, "--format", "ply-sequence", "-o", folder + "/out", "--quiet"],
                 again=False),  # it rejects a folder that is not empty
        replaces(world, "splat", nothing, lambda folder: ["splat", splat, "-o", folder + "/out.npz", "--quiet"],
                 old=("out.npz",)),
        replaces(world, "stress", nothing,
                 lambda folder: ["stress", "--only", "T1", "--json", folder + "/out.json", "--quiet"],
                 ("out.json",), old=("out.json",)),
        replaces(world, "bench", nothing, raster, ("out.json", "plots/"), who="first",
                 old=("out.json", *OLD_PLOTS)),
        replaces(world, "experiment", half_an_experiment(world), experiment, TIMED_OF_EXPERIMENT, who="first",
                 free="seed1")]


def gnuplot(world):
    """The disk is full for gnuplot, which bench starts."""
    return replaces(world, "gnuplot", lambda folder: None, raster, ("out.json", "plots/"), who="gnuplot",
                    old=("out.json", *OLD_PLOTS))
