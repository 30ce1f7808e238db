# SPDX-License-Identifier: Apache-2.0
"""What rasterization() takes and refuses."""
import ast
import inspect
import os
import warnings

import numpy as np
import pytest
from scenes import SIZE, scene, single, without_motion

import gflow
from gflow import _arguments


def call(**changes):
    given = {**single(without_motion(scene())), "width": SIZE[0], "height": SIZE[1], **changes}
    return gflow.rasterization(**given)


@pytest.mark.parametrize("changes, sentence", [
    ({"far_plane": 50}, r"gflow has no far_plane=50: it draws Gaussians at any distance"),
    ({"radius_clip": 3.0}, r"gflow has no radius_clip=3.0: it draws Gaussians of any size; leave it at 0.0"),
    ({"eps2d": 0.1}, r"gflow has no eps2d=0.1: it always adds 0.3"),
    ({"packed": True}, r"gflow has no packed=True: its arrays have a row .* leave it at False"),
    ({"tile_size": 8}, r"gflow has no tile_size=8"),
    ({"sparse_grad": True}, r"gflow has no sparse_grad=True"),
    ({"absgrad": True}, r"gflow has no absgrad=True"),
    ({"rasterize_mode": "antialiased"}, r"gflow has no rasterize_mode='antialiased'"),
    ({"channel_chunk": 16}, r"gflow has no channel_chunk=16"),
    ({"distributed": True}, r"gflow has no distributed=True"),
    ({"camera_model": "fisheye"}, r"gflow has no camera_model='fisheye': its cameras are pinholes"),
    ({"segmented": True}, r"gflow has no segmented=True"),
    ({"covars": np.zeros((14, 3, 3))}, r"gflow has no covars="),
    ({"means": None}, r"argument 'means' is None, expected an array"),
    ({"width": 3.5}, r"argument 'width' is 3.5, expected a whole number"),
    ({"near_plane": "near"}, r"argument 'near_plane' is 'near', expected a number"),
    ({"means": np.array([["a"] * 3])}, r"argument 'means' has elements of type <U1, expected real numbers"),
    ({"with_ut": True}, r"unexpected keyword argument 'with_ut'"),
])
def test_what_gflow_does_not_have_is_a_type_error(changes, sentence):
    with pytest.raises(TypeError, match=sentence):
        call(**changes)


BENT = np.eye(4)[None] * [1.1, 1, 1, 1]
SKEWED = np.array([[[30, 1, 16], [0, 30, 12], [0, 0, 1]]])


@pytest.mark.parametrize("changes, sentence", [
    ({"means": np.zeros((14, 2))}, r"argument 'means' has shape \(14, 2\), expected \(N, 3\)"),
    ({"quats": np.zeros((13, 4))}, r"argument 'quats' has shape \(13, 4\), expected \(14, 4\)"),
    ({"opacities": np.zeros((14, 1))}, r"argument 'opacities' has shape \(14, 1\), expected \(14,\)"),
    ({"opacities": np.full(14, 2.5)}, r"'opacities' has 2.5 for Gaussian 0, expected opacities from 0 to 1, not logits"),
    ({"scales": np.full((14, 3), -2)}, r"'scales' has -2 for Gaussian 0, expected lengths of at least 0, not logarithms"),
    ({"colors": np.zeros((14, 5))}, r"'colors' has shape \(14, 5\), expected \(N, 3\) or \(C, N, 3\): .* three channels"),
    ({"colors": np.zeros((14, 4, 3)), "sh_degree": 2}, r"expected \(N, K, 3\) or \(C, N, K, 3\) with K of at least 9"),
    ({"sh_degree": 4}, r"argument 'sh_degree' is 4, expected 0 to 3"),
    ({"viewmats": np.eye(4)}, r"argument 'viewmats' has shape \(4, 4\), expected \(C, 4, 4\)"),
    ({"viewmats": BENT}, r"camera pose 'viewmats\[0\]' should be a world-to-camera rotation"),
    ({"viewmats": np.full((1, 4, 4), np.nan)}, r"camera pose 'viewmats\[0\]' contains NaN or Inf"),
    ({"Ks": SKEWED}, r"Ks\[0\] should be fx 0 cx, 0 fy cy, 0 0 1: skew is not supported"),
    ({"Ks": -np.eye(3)[None]}, r"Ks\[0\] should hold two focal lengths above 0"),
    ({"backgrounds": np.full((1, 3), np.inf)}, r"argument 'backgrounds' contains NaN or Inf"),
    ({"backgrounds": np.zeros(3)}, r"argument 'backgrounds' has shape \(3,\), expected \(1, 3\)"),
    ({"width": 0}, r"argument 'width, height' is 0 x 24 pixels"),
    ({"near_plane": -1}, r"argument 'near_plane' is -1, expected a distance of at least 0"),
    ({"render_mode": "depth"}, r"argument 'render_mode' is 'depth', expected one of RGB, D, ED, RGB\+D, RGB\+ED"),
    ({"transport": "rigid"}, r"argument 'transport' is 'rigid', expected one of paper, ot, material, translate"),
    ({"stop": "never"}, r"argument 'stop' is 'never', expected one of include, exclude"),
    ({"top_k": -1}, r"argument 'top_k' is -1, expected 0 to 1000000"),
    ({"scales_t2": np.full((14, 3), -1)}, r"argument 'scales_t2' has -1 for Gaussian 0"),
    ({"means": [[1, 2, 3], [4]]}, r"argument 'means' is not an array: its rows differ in length"),
    ({"means_t2": np.zeros((3, 3))}, r"argument 'means_t2' has shape \(3, 3\), expected \(14, 3\)"),
])
def test_values_out_of_range_are_input_errors(changes, sentence):
    with pytest.raises(gflow.InputError, match=sentence) as caught:
        call(**changes)
    assert isinstance(caught.value, ValueError) and isinstance(caught.value, gflow.Error)
    assert str(caught.value).startswith("rasterization: ")


def test_images_larger_than_the_device_are_refused():
    with pytest.raises(gflow.InputError, match=r"images of the size in argument 'width, height' need .* MiB|at once"):
        call(width=65535, height=65535)


def test_tensors_with_gradients_belong_to_gflow_torch():
    torch = pytest.importorskip("torch")
    import gflow.torch
    with pytest.raises(TypeError, match="gflow.torch.rasterization takes tensors with gradients"):
        call(means=torch.zeros(14, 3, requires_grad=True))
    with pytest.raises(TypeError, match="argument 'means' is on meta, expected the CPU"):
        gflow.torch.rasterization(torch.zeros(14, 3, device="meta"), *[None] * 6, width=32, height=24)
    with pytest.raises(TypeError, match="argument 'quats' is not a tensor: "):
        gflow.torch.rasterization(torch.zeros(14, 3), "turned", *[None] * 5, width=32, height=24)


def test_defaults_of_gsplat_are_accepted():
    call(far_plane=1e10, radius_clip=0, eps2d=0.3, packed=False, tile_size=16, rasterize_mode="classic", covars=None)
    call(far_plane=float("inf"))


def test_float32_in_c_order_is_not_copied():
    array = np.zeros((5, 3), np.float32)
    assert np.shares_memory(_arguments.as_array(array, "means"), array)
    assert not np.shares_memory(_arguments.as_array(array.astype(np.float64), "means"), array)


def test_other_types_and_layouts_give_the_same_image():
    s = without_motion(scene())
    exact = gflow.rasterization(**single(s), width=SIZE[0], height=SIZE[1])[0]
    turned = {name: np.asfortranarray(array) for name, array in s.items()}  # double, Fortran order
    np.testing.assert_array_equal(gflow.rasterization(**turned, width=np.int64(32), height=24)[0], exact)
    lists = {**single(s), "Ks": s["Ks"].tolist()}
    np.testing.assert_array_equal(gflow.rasterization(**lists, width=32, height=24)[0], exact)


class OnlyDlpack:
    def __init__(self, array):
        self.array = array

    def __dlpack__(self, **options):
        return self.array.__dlpack__(**options)

    def __dlpack_device__(self):
        return self.array.__dlpack_device__()


def test_dlpack_both_ways():
    array = np.arange(6, dtype=np.float32).reshape(2, 3)
    assert np.shares_memory(_arguments.as_array(OnlyDlpack(array), "means"), array)
    s = single(without_motion(scene()))
    colors = call(means=OnlyDlpack(s["means"]))[0]
    assert np.shares_memory(np.from_dlpack(OnlyDlpack(colors)), colors)


def test_broken_gaussians_are_left_out_and_named():
    s = single(without_motion(scene()))
    s["means"][3, 1] = np.nan
    s["opacities"][5] = np.inf
    _arguments._warned = False
    with pytest.warns(RuntimeWarning, match=r"2 of the Gaussians have non-finite values .* first has index 3") as caught:
        colors, _, meta = gflow.rasterization(**s, width=32, height=24)
    assert caught[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # once
        gflow.rasterization(**s, width=32, height=24)
    assert meta["broken"].tolist() == [3, 5] and np.isfinite(colors).all()
    rest = {name: np.delete(array, [3, 5], 0) if len(array) == 14 else array for name, array in s.items()}
    np.testing.assert_array_equal(gflow.rasterization(**rest, width=32, height=24)[0], colors)


@pytest.mark.parametrize("stub", ["__init__.pyi", "torch.pyi"])
def test_type_stubs_have_the_same_arguments(stub):
    with open(os.path.join(os.path.dirname(gflow.__file__), stub), encoding="utf-8") as file:
        functions = {node.name: node.args for node in ast.parse(file.read()).body if isinstance(node, ast.FunctionDef)}
    for name, args in functions.items():
        signature = inspect.signature(getattr(gflow, name)).parameters.values()
        named = args.posonlyargs + args.args + args.kwonlyargs + ([args.kwarg] if args.kwarg else [])
        assert [arg.arg for arg in named] == [p.name for p in signature]
        defaults = [p.default for p in signature if p.default is not p.empty]
        assert [ast.literal_eval(value) for value in args.defaults + args.kw_defaults] == defaults


def test_devices_are_listed_with_their_checks():
    listed = gflow.devices()
    assert listed[0]["index"] == 0 and listed[0]["usable"] and listed[0]["self_check"]
    assert f"{listed[0]['platform']} / {listed[0]['name']}" in [gflow.device(0)]
    before = gflow.device()
    with pytest.raises(gflow.DeviceError, match="no OpenCL device matches 'abacus'; available: 0: "):
        gflow.device("abacus")
    assert gflow.device() == before


def test_a_capsule_of_dlpack_is_an_array():
    s = single(without_motion(scene()))
    expected = gflow.rasterization(**s, width=SIZE[0], height=SIZE[1])[0]
    s["means"] = s["means"].__dlpack__()
    np.testing.assert_array_equal(gflow.rasterization(**s, width=SIZE[0], height=SIZE[1])[0], expected)
