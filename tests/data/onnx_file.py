# SPDX-License-Identifier: Apache-2.0
"""Writes ONNX files in protobuf's wire format (onnx.proto3), without packages."""
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


def value_info(name, sizes):  # a size given as text is open
    one = lambda size: data(2, size) if isinstance(size, str) else number(1, size)
    shape = b"".join(data(1, one(size)) for size in sizes)
    return data(1, name) + data(2, data(1, number(1, 1) + data(2, shape)))


def ints(name, values):
    return data(1, name) + b"".join(number(8, v) for v in values) + number(20, 7)


def an_int(name, value):
    return data(1, name) + number(3, value) + number(20, 2)


def node(kind, inputs, output, *attributes):
    text = b"".join(data(1, name) for name in inputs) + data(2, output)
    return text + data(3, output) + data(4, kind) + b"".join(data(5, a) for a in attributes)


def model(maker, name, nodes, weights, inputs, output):
    """Bytes of a file; inputs and output as pairs (name, sizes)."""
    graph = b"".join(data(1, n) for n in nodes) + data(2, name)
    graph += b"".join(data(5, w) for w in weights)
    graph += b"".join(data(11, value_info(*i)) for i in inputs) + data(12, value_info(*output))
    return number(1, 7) + data(2, maker) + data(7, graph) + data(8, number(2, 11))
