"""Disk faults: the k-th call that reads a file of a scene, a run or another input fails (EIO)."""
import os
import shutil

from outputs import TIMED_OF_EXPERIMENT, experiment, half_an_experiment, replaces, with_old_results
from trial import Trial, every_call
from world import ROOT, broken_checkpoints, checkpoints_of, settings

# Only these contain the path of the scene.
PLACES = ("config.toml",)


def training(world, name, start):
    """A training of a scene in the folder, from the start or from the checkpoint that `start` puts there."""
    def prepare(folder):
        shutil.copytree(world.scene, folder + "/scene")
        start(folder)

    def check(folder, outcome, before):
        run = folder + "/run"
        wrong = broken_checkpoints(run)
        if "run/checkpoints/iteration_4.npz" in before and not checkpoints_of(run):
            wrong.append("the checkpoint there was is gone")
        wrong += world.differences(run, PLACES) if outcome.code == 0 else []
        return wrong + world.resumed_as_undisturbed(run, PLACES)
    arguments = lambda folder: ["train", folder + "/scene", "-o", folder + "/run", "--resume", *settings()]
    trial = Trial(world, name, prepare, arguments, check, reads=True)
    trial.varies = True  # threads read frames ahead, and again, in any order
    return trial


def copied(*pairs):
    """Copies files and folders there under these names."""
    def prepare(folder):
        for source, name in pairs:
            (shutil.copytree if os.path.isdir(source) else shutil.copy)(source, os.path.join(folder, name))
    return prepare


def trials(world):
    still = world.path("read.splat")
    world.run(["export", world.whole, "-o", still, "--quiet"])
    whole = lambda *more: copied((world.whole, "run"), *more)
    return [
        training(world, "train", lambda folder: None),
        training(world, "resume", lambda folder: shutil.copytree(world.stopped, folder + "/run")),
        replaces(world, "render", whole((world.scene, "scene")),
                 lambda folder: ["render", folder + "/run", "--scene", folder + "/scene", "-o", folder + "/out",
                                 "--quiet"], reads=True),
        replaces(world, "eval", with_old_results(world), lambda folder: ["eval", folder + "/run", "--quiet"],
                 ("results.json",), reads=True),
        replaces(world, "export", whole(), lambda folder: ["export", folder + "/run", "-o", folder + "/out.4dgs",
                                                           "--quiet"], old=("out.4dgs",), reads=True),
        replaces(world, "import", copied((still, "in.splat")),
                 lambda folder: ["import", folder + "/in.splat", "-o", folder + "/out.ply", "--quiet"],
                 old=("out.ply",), reads=True),
        replaces(world, "splat", copied((os.path.join(ROOT, "tests/data/oracle/small_paper.npz"), "in.npz")),
                 lambda folder: ["splat", folder + "/in.npz", "-o", folder + "/out.npz", "--quiet"],
                 old=("out.npz",), reads=True),
        replaces(world, "experiment", half_an_experiment(world), experiment, TIMED_OF_EXPERIMENT, who="first",
                 reads=True, free="seed1")]


def faults(world, every):
    for trial in trials(world):
        yield f"reads: every one of {trial.name}", lambda trial=trial: every_call(trial, every)
