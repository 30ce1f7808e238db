#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Point tracks as a perfect tracker would give them, for flow.tracks: of a scene with true paths in
space (tracks3d.npy) and true flow.

    tracks_of_truth.py SCENE OUT

writes OUT/CAMERA.npz for each camera of SCENE/transforms_train.json: `tracks` [images, points, 2] in
pixels and `visibility` [images, points], of every fourth point: gflow evaluates all. A point is in sight where the true flow of the pixel that
it lies in is its own motion to the next image, within a quarter of a pixel, and the flow's mask
says that the surface is seen at both times. The last image has no flow: there a point is in sight
where it was in the one before. numpy only.
"""
import json
import os
import re
import sys

try:
    import numpy as np
except ImportError:
    sys.exit("tracks_of_truth.py needs numpy (python3-numpy)")

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "guidance"))
from image_files import read_flo, read_png


def cameras_of(scene):
    """{name: [3, 4] from the world to pixels times depth}, each camera once."""
    with open(os.path.join(scene, "transforms_train.json"), encoding="utf-8") as file:
        file = json.load(file)
    cameras = {}
    for frame in file["frames"]:
        parts = re.split(r"[/\\\\]", os.path.normpath(frame["file_path"]))
        name = next(part for part in parts if part not in ("images", "."))
        if name in cameras:
            continue
        image = os.path.join(scene, frame["file_path"])
        height, width = read_png(image if image.endswith(".png") else image + ".png").shape[:2]
        focal = frame.get("fl_x", file.get("fl_x"))
        if focal is None:
            focal = width / 2 / np.tan(file["camera_angle_x"] / 2)
        view = np.linalg.inv(np.array(frame["transform_matrix"]) @ np.diag([1.0, -1, -1, 1]))
        intrinsics = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1.0]])
        cameras[name] = (intrinsics @ view[:3], width, height)
    return cameras


def tracks_of(scene, name, camera, paths):
    projection, width, height = camera
    steps, points = paths.shape[:2]
    homogeneous = np.concatenate([paths, np.ones((steps, points, 1))], 2) @ projection.T
    places = homogeneous[:, :, :2] / homogeneous[:, :, 2:]
    seen = np.zeros((steps, points), bool)
    for t in range(steps - 1):
        base = os.path.join(scene, "flow", name, f"{t:04}")
        flow, known = read_flo(base + (".flo" if os.path.exists(base + ".flo") else ".flo.gz"))
        column, row = np.floor(places[t]).astype(int).T
        inside = (column >= 0) & (row >= 0) & (column < width) & (row < height)
        column, row = column.clip(0, width - 1), row.clip(0, height - 1)
        known &= read_png(base + "_mask.png")[:, :, 0] == 255
        off = np.linalg.norm(flow[:, row, column].T - (places[t + 1] - places[t]), axis=1)
        ahead = (homogeneous[t : t + 2, :, 2] > 0).all(0)
        seen[t] = inside & ahead & known[row, column] & (off < 0.25)
    seen[-1] = seen[-2]
    return places, seen


def main():
    if len(sys.argv) != 3:
        sys.exit("tracks_of_truth.py needs two arguments: a scene and an output folder")
    scene, out = sys.argv[1:]
    for needed in ("tracks3d.npy", "transforms_train.json"):
        if not os.path.isfile(os.path.join(scene, needed)):
            sys.exit(f"tracks_of_truth.py: {scene} has no {needed}")
    paths = np.load(os.path.join(scene, "tracks3d.npy"))[:, ::4].astype(float)
    os.makedirs(out, exist_ok=True)
    for name, camera in cameras_of(scene).items():
        places, seen = tracks_of(scene, name, camera, paths)
        np.savez_compressed(os.path.join(out, name), tracks=places.astype("f4"), visibility=seen)
        print(f"{out}/{name}.npz: {paths.shape[1]} points, {seen.mean():.0%} visible")


if __name__ == "__main__":
    main()
