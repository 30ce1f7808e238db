# SPDX-License-Identifier: Apache-2.0
"""Reads PNG images and .flo optical flow with numpy alone, and brings them to another size."""
import gzip
import struct
import zlib

import numpy as np


def _unfiltered(rows, height, width, step):
    """Undoes PNG's filters (its section 9); rows: [height, 1 + width * step] bytes."""
    out = np.zeros((height, width * step), np.uint8)
    above = np.zeros(width * step, np.uint8)
    for y in range(height):
        kind, row = rows[y, 0], rows[y, 1:]
        if kind == 0:
            line = row
        elif kind == 1:  # the pixel to the left, added up
            line = np.cumsum(row.reshape(width, step), 0, dtype=np.uint32).astype(np.uint8).ravel()
        elif kind == 2:
            line = row + above
        elif kind in (3, 4):
            line = _by_neighbours(kind, row.tolist(), above.tolist(), step)
        else:
            raise ValueError(f"PNG filter {kind} is unknown")
        out[y] = above = line
    return out


def _by_neighbours(kind, row, above, step):
    line = [0] * len(row)
    for i, value in enumerate(row):
        left = line[i - step] if i >= step else 0
        up = above[i]
        if kind == 3:
            guess = (left + up) >> 1
        else:  # Paeth
            corner = above[i - step] if i >= step else 0
            p = left + up - corner
            a, b, c = abs(p - left), abs(p - up), abs(p - corner)
            guess = left if a <= b and a <= c else up if b <= c else corner
        line[i] = (value + guess) & 255
    return np.array(line, np.uint8)


def read_png(path):
    """[height, width, channels] uint8 of an 8-bit grey, RGB or RGBA PNG that is not interlaced."""
    with open(path, "rb") as file:
        data = file.read()
    if data[:8] != b"\x89PNG\r\n\x1a\n":
        raise ValueError(f"{path} is not a PNG file")
    at, packed, size = 8, b"", None
    while at + 8 <= len(data):
        length, kind = struct.unpack(">I4s", data[at : at + 8])
        body = data[at + 8 : at + 8 + length]
        if kind == b"IHDR":
            size = struct.unpack(">IIBBBBB", body)
        elif kind == b"IDAT":
            packed += body
        at += 12 + length
    channels = {0: 1, 2: 3, 4: 2, 6: 4}.get(size[3]) if size else None
    if channels is None or size[2] != 8 or size[6] != 0:
        raise ValueError(f"{path}: only 8-bit grey, RGB and RGBA without interlacing are supported")
    width, height = size[0], size[1]
    rows = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(height, 1 + width * channels)
    return _unfiltered(rows, height, width, channels).reshape(height, width, channels)


def read_rgb(path, background):
    """Planes [3, H, W] float32 in [0, 1] on a background [3]."""
    image = read_png(path).astype(np.float32) / 255
    if image.shape[2] in (1, 2):
        image = np.concatenate([image[:, :, :1]] * 3 + [image[:, :, 1:]], 2)
    rgb = image[:, :, :3]
    if image.shape[2] == 4:
        alpha = image[:, :, 3:]
        rgb = rgb * alpha + (1 - alpha) * np.asarray(background, np.float32)
    return np.ascontiguousarray(rgb.transpose(2, 0, 1))


def read_flo(path):
    """Planes [2, H, W] of a .flo or .flo.gz, and [H, W] bool where the flow is known."""
    with (gzip.open if path.endswith(".gz") else open)(path, "rb") as file:
        data = file.read()
    if data[:4] != b"PIEH":
        raise ValueError(f"{path} is not a .flo file")
    width, height = struct.unpack("<ii", data[4:12])
    flow = np.frombuffer(data, "<f4", 2 * width * height, 12).reshape(height, width, 2)
    known = (np.abs(flow) < 1e9).all(2)
    return np.where(known, flow.transpose(2, 0, 1), 0).astype(np.float32), known


def _overlaps(size, parts):
    """[parts, size]: the share of each of `size` pixels in the mean over each of `parts` stretches."""
    ends = np.arange(parts + 1) * (size / parts)
    pixels = np.arange(size)
    begin = np.maximum(ends[:-1, None], pixels)
    end = np.minimum(ends[1:, None], pixels + 1)
    return np.clip(end - begin, 0, None) * (parts / size)


def resized(planes, height, width):
    """Planes [..., H, W] as [..., height, width] float32: each pixel the mean of what it covers."""
    rows, columns = _overlaps(planes.shape[-2], height), _overlaps(planes.shape[-1], width)
    return (rows @ planes @ columns.T).astype(np.float32)
