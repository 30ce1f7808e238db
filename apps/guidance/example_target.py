#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Guidance towards pictures that are known: a provider whose right answer is certain.

    example_target.py FOLDER

FOLDER/CAMERA/ holds a picture a time step, named by its number (0.png or 0000.png), and
FOLDER/flow/CAMERA/NNNN.flo[.gz] the flow to the next, with NNNN_mask.png where it has one (255: seen
at both times). Views of cameras that are not there get no answer. Use it with
guidance.cameras = "test", whose cameras have names.
"""
import os
import sys

import numpy as np

from gflow_guidance import Answer, fail, serve
from picture_files import read_flo, read_png, read_rgb


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

    def picture(self, camera, frame, background):
        path = self.first(f"{camera}/{frame}.png", f"{camera}/{frame:04}.png")
        if not camera or path is None:
            return None
        return self.once((path, tuple(background)), lambda key: read_rgb(key[0], background))

    def flow(self, camera, frame):
        base = f"flow/{camera}/{frame:04}"
        path = self.first(base + ".flo", base + ".flo.gz")
        if not camera or path is None:
            return None, None
        flow, known = self.once(path, read_flo)
        mask = self.first(base + "_mask.png")
        return flow, known & (self.once(mask, read_png)[:, :, 0] == 255) if mask else known

    def guide(self, request):
        answers = []
        for view in request.views:
            answer = Answer()
            wanted = self.picture(view.camera.name, request.frame, request.background)
            if wanted is not None:
                if wanted.shape != view.rgb.shape:
                    raise ValueError(
                        f"the picture of {view.camera.name} is {wanted.shape[2]}x{wanted.shape[1]},"
                        f" the view {view.camera.width}x{view.camera.height}"
                    )
                answer.gradient = view.rgb - wanted
            if request.next_frame == request.frame + 1:  # what the files lead to
                answer.flow, answer.confidence = self.flow(view.camera.name, request.frame)
            answers.append(answer)
        return answers


if __name__ == "__main__":
    if len(sys.argv) != 2 or not os.path.isdir(sys.argv[1]):
        fail("example_target.py wants one argument, a folder with pictures")
    serve(Target(sys.argv[1]).guide)
