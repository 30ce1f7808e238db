# SPDX-License-Identifier: Apache-2.0
"""Trained models."""
import operator
import os
import tempfile
from dataclasses import dataclass

import numpy as np

from gflow import _core, _program


@dataclass(frozen=True, eq=False)
class Pictures:
    """What Model.render() draws; float32.

    colors [H, W, 3]   sRGB from 0 to 1, background included; noise of training may lead outside
    alphas [H, W, 1]   opacity
    depth [H, W, 1]    expected depth along the camera's axis [scene units]; 0 where nothing is drawn
    flow [H, W, 2]     with t2: where each pixel moves [px], x right, y down; else None
    """
    colors: np.ndarray
    alphas: np.ndarray
    depth: np.ndarray
    flow: np.ndarray

    def image(self):
        """The colours as uint8 [H, W, 3]."""
        return (np.clip(self.colors, 0, 1) * 255 + 0.5).astype(np.uint8)


class Model:
    """A moving splat: from Model.load(), gflow.train() or the callback of a training.

    motion        motion model: "spacetime", "nodes", "hexplane", "keyframes", "bases" or "native4d"
    moving        Gaussians that move, the first ones
    sh_degree     of its colours, 0 to 3
    origin [3]    place in the files' world that its coordinates are relative to; mostly 0
    near_plane    Gaussians nearer to the camera are not drawn, unless render() is told otherwise [scene units]
    state         which model of a run it is, in words; "" for a file
    len(model)    number of Gaussians
    """

    def __init__(self, native, source=None, steps=None):
        self._native, self._source, self._steps = native, source, steps

    @classmethod
    def load(cls, path, iteration=None):
        """The model of a run folder, or of a splat file (.ply, .splat, .spz).

        iteration: of a run, one that has a point cloud or checkpoint; default: the latest, which may be that of a
        training that is still running.
        """
        iteration = None if iteration is None else operator.index(iteration)
        native = _core.Model.load(os.fspath(path), iteration)
        return cls(native, (os.path.abspath(path), iteration))

    motion = property(lambda self: self._native.motion)
    moving = property(lambda self: self._native.moving)
    sh_degree = property(lambda self: self._native.sh_degree)
    origin = property(lambda self: np.array(self._native.origin))
    near_plane = property(lambda self: self._native.near_plane)
    state = property(lambda self: self._native.state)

    def __len__(self):
        return self._native.count

    def __repr__(self):
        return f"<gflow.Model {self.motion}: {len(self)} Gaussians, {self.moving} moving>"

    def save(self, path, **options):
        """Writes the model: as .ply with its motion, which load() reads, else as gflow.export() does, by the ending of
        the name: .4dgs, .splatv and .html with motion; .splat and PLY sequences without."""
        if os.fspath(path).lower().endswith(".ply") and not options:
            return self._native.save(os.fspath(path))
        self._export(path, options)

    def _export(self, path, options):
        if self._source:  # a run has its scene, too
            source, iteration = self._source
            if iteration is not None:
                options = {"iteration": iteration, **options}
            return _program.run_export(source, path, options)
        if self._steps and os.fspath(path).lower().endswith(".4dgs"):
            options = {"steps": self._steps, **options}
        with tempfile.TemporaryDirectory() as folder:
            file = os.path.join(folder, "model.ply")
            self._native.save(file)
            _program.run_export(file, path, options)

    def parameters(self):
        """Copies of the trained arrays by name, flat, as optim/motion documents them."""
        return self._native.parameters()

    def at(self, t):
        """The Gaussians at a time in [0, 1], as rasterization() takes them: a dict of means [N, 3], quats [N, 4],
        scales [N, 3], opacities [N], colors [N, K, 3] and sh_degree.

            gflow.rasterization(**model.at(0.5), viewmats=viewmats, Ks=Ks, width=width, height=height)

        Row i is the same Gaussian at all times; one outside of its time window has opacity 0. Arrays are new.
        """
        return self._native.at(float(t))

    def render(self, camera, t, t2=None, *, camera_t2=None, background=(1.0, 1.0, 1.0), near_plane=None):
        """Draws the model at time t in [0, 1], as `gflow render` does: Pictures.

        camera       a gflow.Camera, such as view.camera of a Scene
        t2           with it there is flow, from t to t2
        camera_t2    the camera at t2; default: it stands still
        near_plane   [scene units]; default: the model's
        """
        if not hasattr(camera, "viewmat"):
            raise TypeError(f"Model.render: argument 'camera' is {camera!r}, expected a gflow.Camera, such as view.camera")
        if len(background) != 3:
            raise _core.InputError(f"Model.render: argument 'background' is {background!r}, expected three numbers")
        second = None if t2 is None else float(t2)
        if camera_t2 is not None and second is None:
            raise TypeError("Model.render: argument 'camera_t2' needs 't2', the time that flow leads to")
        return Pictures(**self._native.render(camera, float(t), second, camera_t2, [float(c) for c in background],
                                              None if near_plane is None else float(near_plane)))
