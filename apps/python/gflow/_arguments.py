# SPDX-License-Identifier: Apache-2.0
"""The arguments of rasterization(), for NumPy and PyTorch alike, and the meta that it returns."""
import operator
import warnings

import numpy as np

from gflow import _core

ARRAYS = ("means", "quats", "scales", "opacities", "colors", "viewmats", "Ks", "backgrounds")
SECOND_TIME = {"means_t2": "means", "quats_t2": "quats", "scales_t2": "scales", "viewmats_t2": "viewmats"}

# Arguments of gsplat.rasterization that have one value here: that value, and what gflow does.
_FIXED = {
    "far_plane": (1e10, "it draws Gaussians at any distance beyond near_plane"),
    "radius_clip": (0.0, "it draws Gaussians of any size"),
    "eps2d": (0.3, "it always adds 0.3 px^2 to the variances of a projected Gaussian"),
    "packed": (False, "its arrays have a row for each camera and Gaussian"),
    "tile_size": (16, "its tiles are 16 x 16 px"),
    "sparse_grad": (False, "its gradients are dense"),
    "absgrad": (False, "the gradient of means2d is the sum over pixels, not that of absolute values"),
    "rasterize_mode": ("classic", "it does not compensate opacities for the 0.3 px^2"),
    "channel_chunk": (32, "it draws three channels at once"),
    "distributed": (False, "it uses one device"),
    "camera_model": ("pinhole", "its cameras are pinholes; undistort images first"),
    "segmented": (False, "it sorts by its own method"),
    "covars": (None, "it takes quats and scales"),
}
_MODES = ("RGB", "D", "ED", "RGB+D", "RGB+ED")
_warned = False


class _Capsule:
    """A DLPack capsule of the CPU as an object that NumPy takes; it can be read once."""

    def __init__(self, capsule):
        self._capsule = capsule

    def __dlpack__(self, stream=None):
        return self._capsule

    def __dlpack_device__(self):
        return 1, 0


def as_array(value, name):
    """A float32 array in C order with the values; the memory of `value` itself where possible."""
    if type(value).__name__ == "PyCapsule":
        value = _Capsule(value)
    if not isinstance(value, np.ndarray) and hasattr(value, "__dlpack__"):
        try:
            value = np.from_dlpack(value)
        except (BufferError, RuntimeError, TypeError, ValueError) as error:
            raise TypeError(f"rasterization: argument '{name}' cannot be read as an array on the CPU ({error}); "
                            "gflow.torch.rasterization takes tensors with gradients") from None
    try:
        array = np.asarray(value)
    except ValueError:
        raise _core.InputError(f"rasterization: argument '{name}' is not an array: its rows differ in length") from None
    if array.dtype.kind not in "fiu":
        raise TypeError(f"rasterization: argument '{name}' has elements of type {array.dtype}, expected real numbers")
    return np.ascontiguousarray(array, dtype=np.float32) if array.ndim else array.astype(np.float32)


def _whole(value, name):
    try:
        return operator.index(value)
    except TypeError:
        raise TypeError(f"rasterization: argument '{name}' is {value!r}, expected a whole number") from None


def _number(value, name):
    try:
        return float(value)
    except (TypeError, ValueError):
        raise TypeError(f"rasterization: argument '{name}' is {value!r}, expected a number") from None


def _one_of(choices, value, name):
    if value not in choices:
        raise _core.InputError(f"rasterization: argument '{name}' is {value!r}, expected one of {', '.join(choices)}")
    return value


def has_motion(given):
    """Whether rasterization(**given) renders flow."""
    return any(given[name] is not None for name in SECOND_TIME)


def _settings(given):
    """The arguments that are not arrays, checked, as _core.Rasterization takes them."""
    for name, (value, instead) in _FIXED.items():
        same = given[name] is value or (given[name] == value if np.isscalar(given[name]) else False)
        if name == "far_plane":
            same = _number(given[name], name) >= value
        if not same:
            raise TypeError(f"rasterization: gflow has no {name}={given[name]!r}: {instead}; leave it at {value!r}")
    mode = _one_of(_MODES, given["render_mode"], "render_mode")
    degree = given["sh_degree"]
    if degree is not None:
        degree = _whole(degree, "sh_degree")
        if not 0 <= degree <= 3:
            raise _core.InputError(f"rasterization: argument 'sh_degree' is {degree}, expected 0 to 3 or None")
    width, height = _whole(given["width"], "width"), _whole(given["height"], "height")
    if not (1 <= width <= 65535 and 1 <= height <= 65535):
        raise _core.InputError(f"rasterization: argument 'width, height' is {width} x {height} pixels, each should be a "
                               "whole number, 1 to 65535")
    top_k = _whole(given["top_k"], "top_k")
    if not 0 <= top_k <= 1000000:
        raise _core.InputError(f"rasterization: argument 'top_k' is {top_k}, expected 0 to 1000000")
    return {"width": width, "height": height, "near_plane": _number(given["near_plane"], "near_plane"),
            "sh_degree": degree, "depth": mode.endswith("D"), "expected_depth": mode.endswith("ED"),
            "transport": _core.transports.index(_one_of(_core.transports, given["transport"], "transport")),
            "stop": _core.stops.index(_one_of(_core.stops, given["stop"], "stop")), "top_k": top_k,
            "flow": has_motion(given)}


def rasterize(given, gradients):
    """Renders rasterization(**given): the _core.Rasterization, its images, and meta."""
    arguments = _settings(given)
    only_depth = given["render_mode"] in ("D", "ED")
    for name in ARRAYS:
        value = given[name]
        if value is None and name != "backgrounds":
            raise TypeError(f"rasterization: argument '{name}' is None, expected an array")
        arguments[name] = None if value is None else as_array(value, name)
    if only_depth:
        arguments["backgrounds"] = None
    for name, first in SECOND_TIME.items():
        value = given[name]
        arguments[name] = arguments[first] if value is None else as_array(value, name)
    raster = _core.Rasterization({**arguments, "gradients": gradients})
    images = raster.images()
    meta = {}
    if arguments["flow"]:
        meta["flow"] = images["flow"]
    if arguments["depth"]:
        meta["depth"] = images["colors"][..., 3:]
    if only_depth:
        images = {**images, "colors": meta["depth"]}
    meta.update(raster.geometry())
    cameras = len(arguments["viewmats"])
    width, height = arguments["width"], arguments["height"]
    meta["opacities"] = np.broadcast_to(arguments["opacities"], (cameras, len(arguments["opacities"])))
    meta["broken"] = np.asarray(raster.broken(), dtype=np.int64)
    meta.update(width=width, height=height, n_cameras=cameras, tile_size=16, tile_width=-(-width // 16),
                tile_height=-(-height // 16))
    _warn_of_broken(meta["broken"])
    return raster, images, meta


def _warn_of_broken(broken):
    global _warned
    if len(broken) and not _warned:
        _warned = True
        warnings.warn(f"{len(broken)} of the Gaussians have non-finite values and are not rendered, or have no flow; the "
                      f"first has index {broken[0]}, meta['broken'] lists all. This warning appears once", RuntimeWarning,
                      stacklevel=4)
