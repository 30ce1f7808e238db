#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes denoiser.onnx beside itself: the smallest network with all inputs that gflow gives,

    noise = A (sample, condition) + B (timestep / 1000, pose) + c

A a 1x1 convolution, B a matrix, by hand in protobuf's wire format (onnx.proto3), without packages.
"""
import os
import struct


def varint(value):
    out = b""
    while value > 127:
        out += bytes([value & 127 | 128])
        value >>= 7
    return out + bytes([value])


def number(field, value):
    return varint(field << 3) + varint(value)


def data(field, value):
    value = value.encode() if isinstance(value, str) else value
    return varint(field << 3 | 2) + varint(len(value)) + value


def tensor(name, sizes, values, kind=1):  # kind 1: float, 7: int64
    packed = struct.pack("<%d%s" % (len(values), "f" if kind == 1 else "q"), *values)
    return b"".join(number(1, s) for s in sizes) + number(2, kind) + data(8, name) + data(9, packed)


def value_info(name, sizes):
    shape = b"".join(data(1, number(1, size)) for size in sizes)
    return data(1, name) + data(2, data(1, number(1, 1) + data(2, shape)))


def ints(name, values):
    return data(1, name) + b"".join(number(8, v) for v in values) + number(20, 7)


def an_int(name, value):
    return data(1, name) + number(3, value) + number(20, 2)


def node(kind, inputs, output, *attributes):
    text = b"".join(data(1, name) for name in inputs) + data(2, output)
    return text + data(3, output) + data(4, kind) + b"".join(data(5, a) for a in attributes)


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
graph = b"".join(data(1, n) for n in nodes) + data(2, "denoiser")
graph += b"".join(data(5, w) for w in weights)
graph += b"".join(data(11, value_info(*i)) for i in inputs) + data(12, value_info("noise", picture))
model = number(1, 7) + data(2, "make_denoiser.py") + data(7, graph) + data(8, number(2, 11))
with open(os.path.join(os.path.dirname(os.path.abspath(__file__)), "denoiser.onnx"), "wb") as file:
    file.write(model)
