#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Guidance towards images that are known: a provider whose right answer is certain.

    example_target.py FOLDER

FOLDER/CAMERA/ holds an image per time step, named by its number (0.png or 0000.png), and
FOLDER/flow/CAMERA/NNNN.flo[.gz] the flow to the next, with NNNN_mask.png where it has one (255: seen
at both times). They are brought to the size of the views. Views of cameras that are not there get no
answer. Use it with guidance.cameras = "test", whose cameras have names.
"""
import os
import sys

from gflow_guidance import Answer, fail, serve  # says it when there is no numpy
import numpy as np
from image_files import read_flo, read_png, read_rgb, resized


def require_shape(what, planes, view):
    """Error unless they are as wide for their height as the view, but for the rounding of sizes."""
    height, width = planes.shape[-2:]
    if not 0.98 < width * view.camera.height / (height * view.camera.width) < 1.02:
        raise ValueError(
            f"the {what} of {view.camera.name} is {width}x{height}, the view"
            f" {view.camera.width}x{view.camera.height}: they must have the same aspect ratio"
        )


class Target:
    def __init__(self, folder):
        self.folder = folder
        self.kept = {}  # what was read, by path

    def once(self, path, read):
        if path not in self.kept:
            self.kept[path] = read(path)
        return self.kept[path]

    def first(self, *names):
        paths = [os.path.join(self.folder, name) for name in names]
        return next((path for path in paths if os.path.isfile(path)), None)

    def image(self, view, frame, background):
        """[3, H, W] in the view's size; None where there is none."""
        camera = view.camera
        path = self.first(f"{camera.name}/{frame}.png", f"{camera.name}/{frame:04}.png")
        if not camera.name or path is None:
            return None
        rgb = self.once((path, tuple(background)), lambda key: read_rgb(key[0], background))
        require_shape("image", rgb, view)
        return resized(rgb, camera.height, camera.width)

    def flow(self, view, frame):
        """[2, H, W] in the view's pixels and [H, W] where it is known; None, None without any."""
        camera = view.camera
        base = f"flow/{camera.name}/{frame:04}"
        path = self.first(base + ".flo", base + ".flo.gz")
        if not camera.name or path is None:
            return None, None
        flow, known = self.once(path, read_flo)
        mask = self.first(base + "_mask.png")
        if mask:
            known = known & (self.once(mask, read_png)[:, :, 0] == 255)
        require_shape("flow", flow, view)
        per_pixel = np.array([camera.width / flow.shape[2], camera.height / flow.shape[1]])
        known = resized(known.astype(np.float32), camera.height, camera.width) > 0.999
        return resized(flow * per_pixel[:, None, None], camera.height, camera.width), known

    def guide(self, request):
        answers = []
        for view in request.views:
            answer = Answer()
            wanted = self.image(view, request.frame, request.background)
            if wanted is not None:
                answer.gradient = view.rgb - wanted
            if request.next_frame == request.frame + 1:  # what the files lead to
                answer.flow, answer.confidence = self.flow(view, request.frame)
            answers.append(answer)
        return answers


if __name__ == "__main__":
    if len(sys.argv) != 2:
        fail("example_target.py needs one argument: a folder of images")
    if not os.path.isdir(sys.argv[1]):
        fail(f"example_target.py: there is no folder {sys.argv[1]}")
    serve(Target(sys.argv[1]).guide)
