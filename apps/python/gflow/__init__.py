# SPDX-License-Identifier: Apache-2.0
"""gflow: 3D Gaussians that move, rendered to colour, opacity, depth and optical flow on any OpenCL device.

    import gflow
    colors, alphas, meta = gflow.rasterization(means, quats, scales, opacities, colors,
                                               viewmats, Ks, width, height)

gflow.rasterization   Gaussians and cameras to images, NumPy in and out, as gsplat.rasterization
gflow.torch           the same for PyTorch tensors, with gradients
gflow.train           trains a moving splat from video, with a callback and losses of your own
gflow.Scene, Model    cameras and images; a trained model, to render, convert and save
gflow.optical_flow    between two images
gflow.export          a model for other programs, or as a page with a viewer
gflow.experiment      many trainings from a file, as a table
gflow.devices         the OpenCL devices and their self-checks
gflow.device          the device in use; chooses another one

Every error of gflow is a gflow.Error. An argument with a wrong value is a gflow.InputError, which is also a
ValueError; something that gflow does not have is a TypeError that says what it does instead.
"""
from gflow import _core
from gflow._arguments import rasterize as _rasterize
from gflow._core import DeviceError, Error, InputError, OutOfMemoryError

__all__ = ["rasterization", "devices", "device", "Error", "InputError", "DeviceError", "OutOfMemoryError"]
if hasattr(_core, "train"):  # built with OpenCV
    from gflow._model import Model, Pictures
    from gflow._program import experiment, export
    from gflow._scene import Camera, Scene, View, optical_flow
    from gflow._train import Objective, RenderedView, TrainResult, TrainState, settings, train

    __all__ += ["Model", "Pictures", "experiment", "export", "Camera", "Scene", "View", "optical_flow", "Objective",
                "RenderedView", "TrainResult", "TrainState", "settings", "train"]

for _class in (Error, InputError, DeviceError, OutOfMemoryError):
    _class.__module__ = "gflow"
Error.__doc__ = "An error of gflow. Its text is one sentence: what was being done, what is wrong, what would be right."
InputError.__doc__ = "An argument has a value, shape or size that it cannot have. Also a ValueError."
DeviceError.__doc__ = "There is no usable OpenCL device, or it failed. Also a RuntimeError."
OutOfMemoryError.__doc__ = "The device has too little memory. Also a MemoryError."


def rasterization(means, quats, scales, opacities, colors, viewmats, Ks, width, height, near_plane=0.01,
                  far_plane=1e10, radius_clip=0.0, eps2d=0.3, sh_degree=None, packed=False, tile_size=16,
                  backgrounds=None, render_mode="RGB", sparse_grad=False, absgrad=False, rasterize_mode="classic",
                  channel_chunk=32, distributed=False, camera_model="pinhole", segmented=False, covars=None,
                  *, means_t2=None, quats_t2=None, scales_t2=None, viewmats_t2=None, transport="material",
                  top_k=0, stop="exclude"):
    """Renders N Gaussians from C cameras: (colors, alphas, meta), as gsplat.rasterization.

    Arrays are NumPy arrays, or have __dlpack__ on the CPU (a PyTorch tensor without gradient). float32 in C order is
    used without a copy, other numbers and layouts are converted. Results are new float32 arrays. Other Python threads
    run while the device works; Ctrl-C stops between two cameras.

    Gaussians
        means [N, 3]        centres [scene units], in world coordinates
        quats [N, 4]        rotations w x y z, of any length but 0
        scales [N, 3]       standard deviations along the axes [scene units], at least 0
        opacities [N]       0 to 1
        colors [N, 3]       or [C, N, 3]; with sh_degree the coefficients [N, K, 3] or [C, N, K, 3], in the order of
                            3DGS files, K at least (sh_degree + 1)^2
        sh_degree           0 to 3: colours are max(0, 0.5 + spherical harmonics to this degree)
    Cameras
        viewmats [C, 4, 4]  world to camera, x right, y down, z forward: a rotation and translation
        Ks [C, 3, 3]        fx 0 cx, 0 fy cy, 0 0 1 [px]; the centre of the first pixel is (0.5, 0.5)
        width, height       1 to 65535 [px]
        near_plane          Gaussians whose centre is nearer are not drawn [scene units]
        backgrounds [C, 3]  colours behind all Gaussians; None: black. Behind depth is 0
    Motion: with any of these there is flow; those not given are as at the first time
        means_t2, quats_t2, scales_t2, viewmats_t2
        transport           how a Gaussian moves the pixels under it: "material" (the projected 3D motion), "paper"
                            (GaussianFlow, eq. 8), "ot" (optimal transport) or "translate" (eq. 9)
        top_k               Gaussians per pixel that contribute to flow, nearest first; 0: all
    render_mode "RGB", "D" (depth), "ED" (expected depth), "RGB+D" or "RGB+ED". Depth is the sum of weight times camera
    z; expected depth is that divided by alpha.
    stop "exclude" (as gsplat): a pixel ends before the Gaussian that would leave less than 1e-4 of the light; "include":
    after it.

    Returns
        colors [C, H, W, X]  X = 3, 1 (depth only) or 4 (depth last); background included
        alphas [C, H, W, 1]  sum of the weights
        meta                 a dict:
            flow [C, H, W, 2]     with motion: where a pixel moves [px], x right, y down; the mean of its Gaussians'
                                  motion by weight, 0 where nothing is drawn
            depth [C, H, W, 1]    with a depth in render_mode: that channel of colors
            radii [C, N, 2]       int32, half the box in which the Gaussian has alpha >= 1/255 [px]; 0: not visible.
                                  For those that are not visible the next three are 0
            means2d [C, N, 2]     projected centres [px]
            depths [C, N]         camera z [scene units]
            conics [C, N, 3]      a b c of the inverse covariance [1/px^2]
            opacities [C, N]
            tiles_per_gauss [C, N]  int32, tiles of 16 x 16 px touched
            broken [B]            Gaussians with a NaN or Inf: drawn without what it affects, or not at all. The first
                                  time there are any, a RuntimeWarning says so
            width, height, n_cameras, tile_size, tile_width, tile_height

    As in gsplat, 0.3 px^2 are added to both variances of a projected Gaussian, and alpha below 1/255 is not drawn.
    gsplat limits alpha to 0.999, gflow to 0.99. gsplat's other arguments may have their defaults only, but packed is
    False. For gradients see gflow.torch.rasterization.
    """
    _, images, meta = _rasterize(dict(locals()), gradients=False)
    return images["colors"], images["alphas"], meta


def devices():
    """The OpenCL devices, each checked, as a list of dicts with the names of `gflow devices --json`.

    Among them: index, name, platform, type ("CPU", "GPU" or "other"), memory_bytes, self_check, usable (bool), and
    reason, why it is not usable. DeviceError if there is none.
    """
    return _core.devices()


def device(wanted=None):
    """The device that rasterizations of this process use, as "platform / name"; opens it if none is open.

    wanted: chooses it by its index in devices() or a part of its name. Without, it is the one of the environment
    variable GFLOW_DEVICE, the first GPU, or the first device. Opening it takes a self-check, and at the very first
    use compiling, some ten seconds. DeviceError if there is no such device or it fails its self-check. A device that
    hangs for GFLOW_DEVICE_TIMEOUT seconds (600) ends the process with exit code 4.
    """
    return _core.device("" if wanted is None else str(wanted))
