#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes denoiser.onnx beside itself: the smallest network with all inputs that gflow provides,

    noise = A (sample, condition) + B (timestep / 1000, pose) + c

A a 1x1 convolution, B a matrix.
"""
import os
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.dirname(HERE))
from onnx_file import an_int, ints, model, node, tensor

SIZE = 8
A = [0.5, 0, 0, 0.25, 0, 0, 0, 0.5, 0, 0, 0.25, 0, 0.125, 0, 0.5, 0, 0, 0.25]  # [3, 6]
B = [2, 0, 0, 0.5, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0.25]  # [5, 3]: timestep / 1000, pose
C = [0.0625, 0, -0.0625]

nodes = [
    node("Concat", ["sample", "condition"], "pictures", an_int("axis", 1)),
    node("Conv", ["pictures", "a", "c"], "mixed", ints("kernel_shape", [1, 1])),
    node("Mul", ["timestep", "thousandth"], "share"),
    node("Concat", ["share", "pose"], "numbers", an_int("axis", 1)),
    node("MatMul", ["numbers", "b"], "row"),
    node("Reshape", ["row", "planes"], "tint"),
    node("Add", ["mixed", "tint"], "noise"),
]
weights = [
    tensor("a", [3, 6, 1, 1], A),
    tensor("c", [3], C),
    tensor("thousandth", [1], [0.001]),
    tensor("b", [5, 3], B),
    tensor("planes", [4], [1, 3, 1, 1], 7),
]
picture = [1, 3, SIZE, SIZE]
inputs = [("sample", picture), ("timestep", [1, 1]), ("condition", picture), ("pose", [1, 4])]
with open(os.path.join(HERE, "denoiser.onnx"), "wb") as file:
    file.write(model("make_denoiser.py", "denoiser", nodes, weights, inputs, ("noise", picture)))
