# SPDX-License-Identifier: Apache-2.0
"""Training."""
import json
import operator
import os
from dataclasses import dataclass, field
from types import SimpleNamespace

from gflow import _core
from gflow._model import Model
from gflow._scene import Scene
from gflow._settings import assignments


@dataclass(frozen=True, eq=False)
class TrainResult:
    """What gflow.train() returns.

    model     the trained Model
    steps     steps made
    run       the run folder, or None
    metrics   contents of results.json of a run with test views, else None: metrics["test"]["psnr"]
    report    path of its report.html, or None
    """
    model: Model
    steps: int
    run: str
    metrics: dict = field(repr=False)  # pages long
    report: str


class TrainState:
    """A training after one of its steps; valid inside of the callback.

    step, steps   made so far, and planned
    loss          of the last step, all terms with their weights
    terms         its terms by name, as in metrics.jsonl: {"l1": ..., "psnr": ...}; NaN where not evaluated
    gaussians     their number, and `moving`, those that move
    model         a copy of the model as it is now
    """

    def __init__(self, native):
        self._native = native
        self._values = None

    step = property(lambda self: self._native.step)
    steps = property(lambda self: self._native.steps)
    loss = property(lambda self: self._report()["loss"])
    terms = property(lambda self: self._report()["terms"])
    gaussians = property(lambda self: self._report()["gaussians"])
    moving = property(lambda self: self._report()["moving"])

    @property
    def model(self):
        return Model(self._native.model())

    def _report(self):  # reading it waits for the device
        if self._values is None:
            self._values = self._native.report()
        return self._values


class RenderedView(SimpleNamespace):
    """A view of a training step, as an Objective receives it; float32 arrays. Of a large image some steps draw a part.

    colors [h, w, 3]   as rendered
    alphas [h, w, 1]
    depth [h, w, 1]    sum of weight times depth, with channels = ("depth",); divide by alphas for the expected depth
    flow [h, w, 2]     to time_t2 [px], with channels = ("flow",); both None otherwise
    truth [h, w, 3]    the image to compare with
    step               of the training, from 0
    name, time         of the view
    time_t2            [0, 1]
    left, top          of the part in the whole image [px]
    share              pixels of the part / pixels of the image
    """


class Objective:
    """A loss of your own, added to those of gflow: derive from it and define __call__.

        class Darker(gflow.Objective):
            name = "darker"
            def __call__(self, view):
                return 0.1 * view.colors.mean(), {"colors": np.full_like(view.colors, 0.1 / view.colors.size)}

    __call__(view) gets a RenderedView and returns the weighted loss and its gradients by the images: a dict with any of
    "colors", "alphas", "depth" and "flow", in their shapes. It is called once for each view of each step.

    name       of the term, in logs and TrainState.terms
    channels   what must be rendered besides colours and alpha: "depth", "flow". gflow renders flow only in steps that
               compare it with target flow; with this, in all steps
    """
    name = "objective"
    channels = ()

    def __call__(self, view):
        raise NotImplementedError("an Objective defines __call__(self, view), which returns (loss, gradients)")

    def _call(self, fields):
        result = self(RenderedView(**{"depth": None, "flow": None, **fields}))
        try:
            loss, gradients = result
            return float(loss), dict(gradients)
        except (TypeError, ValueError):
            raise TypeError(f"objective '{self.name}' returned {type(result).__name__}, expected (loss, "
                            "{'colors': gradient})") from None


def _check(objective):
    channels = objective.channels
    if not isinstance(objective.name, str) or not objective.name:
        raise _core.InputError(f"an objective has the name {objective.name!r}, expected a text")
    if isinstance(channels, str) or not all(channel in ("depth", "flow") for channel in channels):
        raise _core.InputError(f"objective '{objective.name}': its channels are {channels!r}, expected a tuple of "
                               "'depth' and 'flow'")


def train(scene, /, run=None, callback=None, *, every=1, objectives=(), quality="", config="", resume=False,
          overwrite=False, quiet=False, iterations=None, resolution=None, seed=None, **settings):
    """Trains a moving splat: a TrainResult. As `gflow train`, with the same bits.

        result = gflow.train("scenes/baton", "runs/baton", iterations=3000, flow={"weight": 0.2})
        image = result.model.render(camera, 0.5).image()

    scene        a folder, a video, or a gflow.Scene. Of a video whose camera moves the poses are found first
    run          folder to write, as the command does: models, metrics, checkpoints, report.html. None: nothing is
                 written, and nothing is evaluated
    callback     called with a TrainState after each step that `every` divides, and after the last one. If it returns
                 something true the training ends; its exceptions end it, too, and pass through when a run is saved
    objectives   Objective objects, added to gflow's losses
    quality      "draft", "standard" or "best": how long to train
    config       a TOML file of settings
    resume       continue the run from its last checkpoint, with its settings
    overwrite    replace a run that is in the folder
    quiet        no progress on stderr
    iterations, resolution, seed    as --iterations, --resolution and --seed
    settings     all others, by section: flow={"weight": 0.2}, motion={"model": "nodes"}. `gflow settings` lists them

    Warnings of the training are RuntimeWarnings. Ctrl-C ends it after the current step; a run saves its model and a
    checkpoint first. Other Python threads go on meanwhile, and the callback may render.
    """
    def shortcut(section, name, value):
        if value is None:
            return []
        if name in settings.get(section, {}) or f"{section}.{name}" in settings:
            raise TypeError(f"gflow.train: '{name}' is given twice, the other one as {section}.{name}")
        return assignments({section: {name: value}})

    words = assignments(settings)
    for section, name, value in (("train", "iterations", iterations), ("scene", "resolution", resolution),
                                 ("train", "seed", seed)):
        words += shortcut(section, name, value)
    if isinstance(scene, Scene):
        of_scene = [word for word in words if word.startswith("scene.")]
        if of_scene:
            raise TypeError(f"gflow.train: {of_scene[0]} comes too late for a gflow.Scene: give it to Scene(...)")
        scene = scene._native
    else:
        scene = os.fspath(scene)
    if callback is not None and not callable(callback):
        raise TypeError(f"gflow.train: argument 'callback' is {callback!r}, expected a function of a TrainState")
    objectives = list(objectives)
    for objective in objectives:
        if not isinstance(objective, Objective):
            raise TypeError(f"gflow.train: {objective!r} is not a gflow.Objective object")
        _check(objective)
    if len({objective.name for objective in objectives}) < len(objectives):
        raise _core.InputError("gflow.train: two objectives have the same name, but terms are told apart by it")
    if run is None and (resume or overwrite):
        raise TypeError("gflow.train: 'resume' and 'overwrite' need 'run', the folder of the run")
    if resume and overwrite:
        raise TypeError("gflow.train: 'resume' continues a run and 'overwrite' replaces it: give one of them")
    if operator.index(every) < 1:
        raise _core.InputError(f"gflow.train: argument 'every' is {every}, expected a number of steps from 1 on")
    folder = "" if run is None else os.fspath(run)
    call = None if callback is None else lambda native: callback(TrainState(native))
    result = _core.train({"scene": scene, "run": folder, "callback": call, "every": every,
                          "objectives": objectives, "quality": quality, "config": os.fspath(config),
                          "settings": words, "resume": resume, "overwrite": overwrite, "quiet": quiet})
    metrics = None
    results = os.path.join(folder, "results.json")
    if folder and os.path.exists(results):
        with open(results, encoding="utf-8") as text:
            metrics = json.load(text)
    source = (os.path.abspath(folder), result["steps"]) if folder else None
    model = Model(result["model"], source, result["scene_steps"])
    return TrainResult(model, result["steps"], folder or None, metrics, result["report"] or None)


def settings():
    """The settings of training, as a list of dicts: name, value (the default, as TOML), meaning, allowed."""
    return _core.settings()
