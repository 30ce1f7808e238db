# SPDX-License-Identifier: Apache-2.0
"""gflow.rasterization for PyTorch tensors, with gradients of every image by everything at both times.

    import torch, gflow.torch
    colors, alphas, meta = gflow.torch.rasterization(means, quats, scales, opacities, colors, viewmats, Ks, 256, 256)
    ((colors - image) ** 2).mean().backward()

Tensors are on the CPU, from where the OpenCL device takes them; torch 1.13 and newer.
"""
import inspect

import torch

import gflow
from gflow._arguments import ARRAYS, SECOND_TIME, as_array, has_motion, rasterize

__all__ = ["rasterization"]

_TENSORS = ARRAYS + tuple(SECOND_TIME)
_WITHOUT_GRADIENT = ("Ks",)


class _Rasterize(torch.autograd.Function):
    """Tensors in the order of _TENSORS to colors, alphas and flow (None without motion)."""

    @staticmethod
    def forward(ctx, call, *tensors):
        given = {**call.given, **dict(zip(_TENSORS, tensors))}
        arrays = {name: None if t is None else t.detach().numpy() for name, t in zip(_TENSORS, tensors)}
        ctx.raster, images, call.meta = rasterize({**given, **arrays}, gradients=any(ctx.needs_input_grad))
        ctx.set_materialize_grads(False)
        ctx.means2d = call.meta["means2d"] = torch.from_numpy(call.meta["means2d"])
        ctx.dtypes = [None if t is None else t.dtype for t in tensors]
        ctx.alphas = images["alphas"].copy()  # the caller may change those it gets
        dtype = tensors[0].dtype
        made = {name: torch.from_numpy(array).to(dtype) for name, array in images.items()}
        return made["colors"], made["alphas"], made.get("flow")

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx, v_colors, v_alphas, v_flow):
        cotangents = {"colors": v_colors, "alphas": v_alphas, "flow": v_flow}
        cotangents = {name: as_array(v, name) for name, v in cotangents.items() if v is not None}
        if "colors" in cotangents and cotangents["colors"].shape[-1] == 1:  # depth only: not the first three channels
            only = cotangents["colors"]
            cotangents["colors"] = only.repeat(4, axis=-1)
            cotangents["colors"][..., :3] = 0
        wanted = [name for name, needs in zip(_TENSORS, ctx.needs_input_grad[1:]) if needs]
        gradients = ctx.raster.backward(cotangents, wanted + ["means2d"])
        if "backgrounds" in wanted and v_colors is not None and v_colors.shape[-1] >= 3:
            gradients["backgrounds"] = (as_array(v_colors, "colors")[..., :3] * (1 - ctx.alphas)).sum((1, 2))
        _add_means2d(ctx.means2d, gradients["means2d"])
        return (None, *(torch.from_numpy(gradients[name]).to(dtype) if name in gradients else None
                        for name, dtype in zip(_TENSORS, ctx.dtypes)))


def _add_means2d(means2d, gradient):
    gradient = torch.from_numpy(gradient).to(means2d.dtype)
    means2d.grad = gradient if means2d.grad is None else means2d.grad + gradient


class _Call:
    """What forward() gets besides tensors, and the meta that it makes. Nothing of the graph refers to it: meta refers to
    the graph, and the device's memory would wait for a collector of cycles."""

    def __init__(self, given):
        self.given, self.meta = given, None


def _tensor(value, name):
    try:
        tensor = torch.as_tensor(value)
    except (TypeError, ValueError, RuntimeError) as error:
        raise TypeError(f"rasterization: argument '{name}' is not a tensor: {error}") from None
    if tensor.device.type != "cpu":
        raise TypeError(f"rasterization: argument '{name}' is on {tensor.device}, expected the CPU, from where gflow's "
                        "OpenCL device takes it: use .cpu()")
    if not tensor.dtype.is_floating_point:
        tensor = tensor.to(torch.get_default_dtype())
    if tensor.requires_grad and name in _WITHOUT_GRADIENT:
        raise TypeError(f"rasterization: argument '{name}' requires a gradient, but gflow has none by the intrinsics of "
                        "a camera: use .detach()")
    return tensor


def rasterization(*args, **kwargs):
    given = _signature.bind(*args, **kwargs)
    given.apply_defaults()
    given = given.arguments
    tensors = {name: None if given[name] is None else _tensor(given[name], name) for name in _TENSORS}
    if has_motion(given):  # what does not move has gradients of both times
        for name, first in SECOND_TIME.items():
            tensors[name] = tensors[first] if tensors[name] is None else tensors[name]
    for name in ARRAYS:
        if tensors[name] is None and name != "backgrounds":
            raise TypeError(f"rasterization: argument '{name}' is None, expected a tensor")
    call = _Call({name: value for name, value in given.items() if name not in tensors})
    colors, alphas, flow = _Rasterize.apply(call, *(tensors[name] for name in _TENSORS))
    meta = call.meta
    for name, value in meta.items():
        if name not in ("flow", "depth", "opacities", "means2d") and hasattr(value, "dtype"):
            meta[name] = torch.from_numpy(value)
    meta["means2d"].requires_grad_(torch.is_grad_enabled() and colors.requires_grad)
    meta["opacities"] = tensors["opacities"].expand(meta["n_cameras"], -1)
    if flow is not None:
        meta["flow"] = flow
    if "depth" in meta:
        meta["depth"] = colors[..., -1:]
    return colors, alphas, meta


_signature = inspect.signature(gflow.rasterization)
rasterization.__signature__ = _signature
rasterization.__doc__ = """gflow.rasterization for tensors on the CPU, differentiable.

    Arguments and results are those of gflow.rasterization, with tensors for arrays; see help(gflow.rasterization).
    float32 in C order is used without a copy; others are converted, and images and gradients have their type.

    colors, alphas, meta["depth"] and meta["flow"] have gradients by means, quats, scales, opacities, colors (spherical
    harmonics too, and by the direction of view), backgrounds, viewmats, and the four arguments of the second time; not
    by Ks. Those by viewmats are along rigid motions of the camera: any parameters of a rotation and translation have
    the right gradient, and the entries of the matrix none that would bend it.

    meta["means2d"].grad is set by backward(), as after retain_grad() in gsplat, for density control: the gradient of
    colours, alpha and depth (not flow) by the projected centres [1/px]. The other entries of meta have no gradient,
    and a loss on means2d has none either.
    """
