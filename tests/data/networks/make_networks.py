#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes the smallest networks for perceptual metrics beside itself:

    lpips.onnx        mean over pixels of L . (relu(P image) - relu(T truth))^2
    lpips_6x4.onnx    the same for images of 6 x 4 pixels only
    map.onnx          the same without the mean, so its output is an image
    clip.onnx         mean over pixels of relu(E image + e), four values, of any size
    clip_16.onnx      the same for images of 16 x 16 pixels only
    oblong.onnx       the same for images of 16 x 8
    zero.onnx         the same with E and e zero
    unknown.onnx      an unknown operation

P, T, E are 1x1 convolutions. Unlike LPIPS, the network is not symmetric, so a test detects swapped
images.
"""
import os
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.dirname(HERE))
from onnx_file import ints, model, node, tensor

P = [1, 0.5, 0, -0.5, 0, 1]  # [2, 3]
T = [0.75, 0.5, 0, -0.5, 0.25, 1]
L = [0.5, 2]
E = [1, 0, 0, 0, 1, 0, 0, 0, 1, 0.5, -0.25, 0.125]  # [4, 3]
e = [0.5, 0.25, 0, 1]
ONE = ints("kernel_shape", [1, 1])


def write(name, nodes, weights, inputs, output):
    with open(os.path.join(HERE, name), "wb") as file:
        file.write(model("make_networks.py", "judge", nodes, weights, inputs, output))


def lpips(name, height, width, mean=True):
    nodes = [
        node("Conv", ["picture", "p"], "a0", ONE),
        node("Relu", ["a0"], "a"),
        node("Conv", ["truth", "t"], "b0", ONE),
        node("Relu", ["b0"], "b"),
        node("Sub", ["a", "b"], "d"),
        node("Mul", ["d", "d"], "squares"),
        node("Conv", ["squares", "l"], "map" if mean else "distance", ONE),
    ]
    if mean:
        nodes.append(node("GlobalAveragePool", ["map"], "distance"))
    weights = [tensor("p", [2, 3, 1, 1], P), tensor("t", [2, 3, 1, 1], T), tensor("l", [1, 2, 1, 1], L)]
    picture = [1, 3, height, width]
    write(name, nodes, weights, [("picture", picture), ("truth", picture)],
          ("distance", [1, 1, 1, 1] if mean else [1, 1, height, width]))


def clip(name, height, width, scale=1):
    nodes = [
        node("Conv", ["picture", "e", "bias"], "x0", ONE),
        node("Relu", ["x0"], "x"),
        node("GlobalAveragePool", ["x"], "mean"),
        node("Flatten", ["mean"], "embedding"),
    ]
    weights = [tensor("e", [4, 3, 1, 1], [scale * v for v in E]), tensor("bias", [4], [scale * v for v in e])]
    write(name, nodes, weights, [("picture", [1, 3, height, width])], ("embedding", [1, 4]))


lpips("lpips.onnx", "height", "width")
lpips("lpips_6x4.onnx", 4, 6)
lpips("map.onnx", 4, 6, mean=False)
clip("clip.onnx", "height", "width")
clip("clip_16.onnx", 16, 16)
clip("oblong.onnx", 8, 16)
clip("zero.onnx", 16, 16, scale=0)
write("unknown.onnx", [node("NoSuchOperation", ["picture"], "embedding")], [],
      [("picture", [1, 3, 16, 16])], ("embedding", [1, 4]))
