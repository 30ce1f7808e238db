# SPDX-License-Identifier: Apache-2.0
"""Scenes: cameras and images at times."""
import operator
import os
from dataclasses import dataclass

import numpy as np

from gflow import _core
from gflow._settings import assignments


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera, or one pose of a moving one.

    viewmat [4, 4]  world to camera, x right, y down, z forward: a rotation and translation
    K [3, 3]        fx 0 cx, 0 fy cy, 0 0 1 [px]; the centre of the first pixel is (0.5, 0.5)
    width, height   [px]
    """
    viewmat: np.ndarray
    K: np.ndarray
    width: int
    height: int
    name: str = ""

    def __post_init__(self):
        for side in ("width", "height"):
            object.__setattr__(self, side, operator.index(getattr(self, side)))

    @property
    def position(self):
        """The centre of the camera in the world, [3]."""
        viewmat = np.asarray(self.viewmat, dtype=np.float64)
        return -viewmat[:3, :3].T @ viewmat[:3, 3]

    def resized(self, width, height):
        """The camera of the image resized to this many pixels."""
        width, height = round(width), round(height)
        K = np.array(self.K, dtype=np.float64)
        K[0] *= width / self.width
        K[1] *= height / self.height
        return Camera(self.viewmat, K, width, height, self.name)


class View:
    """One image of a scene: its name, camera, time in [0, 1], time step, and the track of cameras that it belongs to."""

    def __init__(self, scene, split, index, fields):
        self._of, self.split = (scene, split, index), split
        self.name, self.time, self.step, self.track = (fields[key] for key in ("name", "time", "step", "track"))
        self.camera = Camera(**fields["camera"])

    def __repr__(self):
        return f"<gflow.View {self.name}, time {self.time:g}>"

    def image(self):
        """The image, uint8 [H, W, 3] sRGB, or [H, W, 4] with straight alpha; without lens distortion, in the size of
        the camera. Read when it is asked for, and kept for a while."""
        return self._of[0].image(*self._of[1:])

    def true_flow(self):
        """(flow [H, W, 2] px, known [H, W] bool, time it leads to) where the scene has true flow, else None. It is that
        of this camera standing still."""
        return self._of[0].true_flow(*self._of[1:])


class Scene:
    """A scene as `gflow train` reads it: a folder of any known layout, or a video.

        scene = gflow.Scene("scenes/baton", resolution=2)
        scene.train[0].image()

    resolution divides width and height of the images: 1, 2, 4 or 8. Other settings of the section `scene` are keyword
    arguments too: Scene(path, test_every=4).

    train, test, val        lists of View: for training, held out, and for validation
    cameras                 the different cameras of train
    points                  (means [P, 3], colors uint8 [P, 3] or None), the scene's initial points
    steps, fps              distinct training times, and how many there are per second
    extent                  size of the scene [scene units]
    near_plane              Gaussians nearer to a camera are not drawn [scene units]
    origin [3]              place in the files' world that all coordinates are relative to; mostly 0
    name, path, layout, notices
    """

    def __init__(self, path, resolution=1, **settings):
        self._open(_core.Scene.read(os.fspath(path), assignments({"scene": {"resolution": resolution, **settings}})))

    @classmethod
    def of(cls, images, cameras, times, *, tracks=None, splits=None, points=None, colors=None, fps=24.0):
        """A scene of arrays.

        images    uint8 [H, W, 3], or [H, W, 4] with straight alpha, one per view
        cameras   a Camera per view
        times     [0, 1] per view
        tracks    a number per view: views of one camera, at rest or moving, share it. Default: views with an equal
                  camera do, and views of cameras that are all different are of one that moves
        splits    "train", "test" or "val" per view. Default: all train
        points    initial points [P, 3] in the world, with colors uint8 [P, 3]
        fps       time steps per second
        """
        images, cameras, times = list(images), list(cameras), [float(t) for t in times]
        count = len(images)
        tracks = _tracks(cameras) if tracks is None else [int(track) for track in tracks]
        splits = ["train"] * count if splits is None else list(splits)
        for name, values in (("cameras", cameras), ("times", times), ("tracks", tracks), ("splits", splits)):
            if len(values) != count:
                raise _core.InputError(f"a scene of {count} images: argument '{name}' has {len(values)} entries, "
                                       "expected one per image")
        for time in times:
            if not 0 <= time <= 1:
                raise _core.InputError(f"a scene of arrays: argument 'times' has {time}, expected 0 to 1")
        for split in splits:
            if split not in ("train", "test", "val"):
                raise _core.InputError(f"a scene of arrays: argument 'splits' has {split!r}, expected train, test or val")
        views = [{"image": _image(image, camera, i), "camera": camera, "time": time, "track": track, "split": split}
                 for i, (image, camera, time, track, split) in enumerate(zip(images, cameras, times, tracks, splits))]
        if not 0 < fps < np.inf:
            raise _core.InputError(f"a scene of arrays: argument 'fps' is {fps}, expected time steps per second")
        if points is not None:
            points = np.ascontiguousarray(points, dtype=np.float64)
            colors = np.full(points.shape, 128) if colors is None else np.asarray(colors)
            if colors.dtype.kind not in "iu" or (colors < 0).any() or (colors > 255).any():
                raise _core.InputError("a scene of arrays: argument 'colors' should be whole numbers, 0 to 255")
            if not np.isfinite(points).all():
                raise _core.InputError("a scene of arrays: argument 'points' has a NaN or Inf")
            colors = np.ascontiguousarray(colors, np.uint8)
            if points.ndim != 2 or points.shape[1] != 3 or colors.shape != points.shape:
                raise _core.InputError(f"a scene of arrays: arguments 'points' and 'colors' have shapes {points.shape} "
                                       f"and {colors.shape}, expected (P, 3) both")
        scene = cls.__new__(cls)
        scene._open(_core.Scene.of(views, points, colors, float(fps), []))
        return scene

    def _open(self, native):
        self._native = native
        for split in ("train", "test", "val"):
            setattr(self, split, [View(native, split, i, fields) for i, fields in enumerate(native.views(split))])
        for name in ("name", "path", "layout", "steps", "fps", "extent", "near_plane", "notices"):
            setattr(self, name, getattr(native, name))
        self.origin = np.array(native.origin)

    @property
    def cameras(self):
        distinct = {(view.camera.name, np.asarray(view.camera.viewmat).tobytes()): view.camera for view in self.train}
        return list(distinct.values())

    @property
    def points(self):
        points = self._native.points()
        return points["means"], points["rgb"]

    def __repr__(self):
        return (f"<gflow.Scene {self.path or self.name}: {len(self.train)} training, {len(self.test)} test views, "
                f"{self.steps} time steps>")


def _tracks(cameras):
    keys = [(np.asarray(c.viewmat, float).tobytes(), np.asarray(c.K, float).tobytes()) for c in cameras]
    order = {key: i for i, key in enumerate(dict.fromkeys(keys))}
    return [0] * len(keys) if len(order) == len(keys) else [order[key] for key in keys]


def _image(image, camera, index):
    image = np.asarray(image)
    wanted = [(camera.height, camera.width, channels) for channels in (3, 4)]
    if image.dtype != np.uint8 or image.shape not in wanted:
        raise _core.InputError(f"a scene of arrays: image {index} is {image.dtype} of shape {image.shape}, expected uint8 "
                               f"of shape {wanted[0]} as its camera, or with four channels")
    return np.ascontiguousarray(image)


def optical_flow(a, b):
    """Optical flow from image a to image b, as gflow computes it for training: OpenCV's DIS in both directions.

    a, b: uint8 [H, W, 3] of one size. Returns flow [H, W, 2], the motion of each pixel [px], x right, y down; and
    consistent [H, W] bool, where flow back from b leads to where it began.
    """
    a, b = np.ascontiguousarray(a), np.ascontiguousarray(b)
    for name, image in (("a", a), ("b", b)):
        if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
            raise _core.InputError(f"optical_flow: argument '{name}' is {image.dtype} of shape {image.shape}, expected "
                                   "uint8 of shape (H, W, 3)")
    if a.shape != b.shape:
        raise _core.InputError(f"optical_flow: the images have shapes {a.shape} and {b.shape}, expected the same")
    return _core.optical_flow(a, b)
