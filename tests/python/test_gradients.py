# SPDX-License-Identifier: Apache-2.0
"""Gradients of gflow.torch.rasterization against PyTorch's of the double-precision reference."""
import os

import numpy as np
import pytest
from scenes import SIZE, one_view, scene, single, without_motion

torch = pytest.importorskip("torch")
import reference  # noqa: E402

import gflow.torch  # noqa: E402

GAUSSIANS = ("means", "quats", "scales", "opacities", "colors", "means_t2", "quats_t2", "scales_t2")
ORACLE = os.path.join(os.path.dirname(__file__), "../data/oracle")


def moved(move, viewmat):
    """The viewmat after a small motion of the camera, rotation and translation [6]; its slope at 0 is exact."""
    w, zero = move[:3], torch.zeros((), dtype=move.dtype)
    step = torch.stack([torch.stack([zero, -w[2], w[1], move[3]]), torch.stack([w[2], zero, -w[0], move[4]]),
                        torch.stack([-w[1], w[0], zero, move[5]]), torch.stack([zero] * 4)])
    return viewmat + step @ viewmat


def leaves(s, dtype):
    tensors = {name: torch.tensor(array, dtype=dtype) for name, array in s.items()}
    moves = {name: torch.zeros(len(s["viewmats"]), 6, dtype=dtype) for name in ("move", "move_t2")}
    for name, tensor in {**tensors, **moves}.items():
        tensor.requires_grad_(name in GAUSSIANS or name in ("move", "move_t2", "backgrounds"))
    given = dict(tensors)
    for name, move in (("viewmats", "move"), ("viewmats_t2", "move_t2")):
        given[name] = torch.stack([moved(m, v) for m, v in zip(moves[move], tensors[name])])
    return {**tensors, **moves}, given


def drawn_by_gflow(given, **options):
    colors, alphas, meta = gflow.torch.rasterization(**given, width=SIZE[0], height=SIZE[1], **options)
    images = {"alpha": alphas[..., 0]}
    if colors.shape[-1] >= 3:
        images["rgb"] = colors[..., :3]
    if "flow" in meta:
        images["flow"] = meta["flow"]
    if "depth" in meta:
        images["expected depth" if options["render_mode"].endswith("ED") else "depth"] = meta["depth"][..., 0]
    return images, meta


def drawn_by_reference(given, **options):
    views = [reference.render(one_view(given, c, lambda t: t), SIZE, **options) for c in range(len(given["viewmats"]))]
    images = {name: torch.stack([view[name] for view in views]) for name in ("rgb", "alpha", "depth", "flow", "sure")}
    images["expected depth"] = images["depth"] / images["alpha"].clamp_min(1e-10)
    return images


def compare(s, bound=2e-5, losses=("rgb", "alpha", "flow"), mode="RGB", **options):
    """Every gradient of every loss, by relative L2 error."""
    for loss in losses:
        exact_leaves, exact_given = leaves(s, torch.float64)
        exact = drawn_by_reference(exact_given, **options)
        actual_leaves, actual_given = leaves(s, torch.float32)
        actual, _ = drawn_by_gflow(actual_given, render_mode=mode, **options)
        cotangent = torch.tensor(np.random.default_rng(5).standard_normal(tuple(exact[loss].shape))).float()
        sure = exact["sure"] if exact[loss].ndim == 3 else exact["sure"][..., None]
        cotangent = cotangent * sure
        (exact[loss] * cotangent).sum().backward()
        (actual[loss] * cotangent).sum().backward()
        compared = 0
        for name, leaf in exact_leaves.items():
            if leaf.grad is None or leaf.grad.norm() < 1e-9:
                continue
            assert actual_leaves[name].grad is not None, f"{loss} by {name}"
            error = ((actual_leaves[name].grad - leaf.grad).norm() / leaf.grad.norm()).item()
            assert error < bound, f"{loss} by {name}: relative error {error:.1e}"
            compared += 1
        assert compared >= (7 if loss == "flow" else 5), loss


@pytest.mark.parametrize("transport", ["material", "paper", "ot", "translate"])
def test_images_by_everything_at_both_times(transport):
    compare(scene(), transport=transport)


def test_depth_and_expected_depth():
    compare(scene(), losses=["rgb", "alpha", "depth"], mode="RGB+D")
    compare(scene(), losses=["expected depth"], mode="RGB+ED")
    compare(scene(), losses=["depth"], mode="D")
    compare(scene(), losses=["expected depth"], mode="ED")


def test_a_batch_adds_its_gradients():
    compare(scene(cameras=3))


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_spherical_harmonics_and_the_direction_of_view(degree):
    compare(scene(sh_degree=3, cameras=2), losses=["rgb"], sh_degree=degree)


@pytest.mark.parametrize("options", [{"stop": "include"}, {"top_k": 3}])
def test_rules(options):
    compare(scene(n=30, seed=2), bound=1e-4, **options)


@pytest.mark.parametrize("name", ["small_material", "small_paper"])
@pytest.mark.parametrize("loss", ["rgb", "alpha", "depth", "flow"])
def test_oracle(name, loss):
    with np.load(os.path.join(ORACLE, name + ".npz")) as file:
        s = dict(file)
    tensors = {n: torch.tensor(s[n], requires_grad=True) for n in GAUSSIANS}
    batch = {n: s[o][None] for n, o in {"viewmats": "viewmat", "viewmats_t2": "viewmat_t2", "Ks": "K",
                                        "backgrounds": "background"}.items()}
    width, height = (int(side) for side in s["size"])
    colors, alphas, meta = gflow.torch.rasterization(**tensors, **batch, width=width, height=height, stop="include",
                                                     render_mode="RGB+D", transport=name[6:])
    images = {"rgb": colors[0, ..., :3], "alpha": alphas[0, ..., 0], "depth": colors[0, ..., 3], "flow": meta["flow"][0]}
    (images[loss] * torch.tensor(s["v_" + loss])).sum().backward()
    compared = [n for n in GAUSSIANS if np.abs(s.get(f"g_{loss}_{n}", 0)).max() > 0]
    assert len(compared) >= 4
    for n in compared:
        exact = s[f"g_{loss}_{n}"]
        assert np.linalg.norm(tensors[n].grad.numpy() - exact) < 1e-5 * np.linalg.norm(exact), n


def test_what_does_not_move_has_gradients_of_both_times():
    s = scene()
    still = {**s, **{name + "_t2": s[name] for name in ("means", "quats", "scales")}}
    exact_leaves, exact_given = leaves(still, torch.float64)
    for name in ("means", "quats", "scales"):
        exact_given[name + "_t2"] = exact_leaves[name]
    actual_leaves, given = leaves(s, torch.float32)
    given = {name: t for name, t in given.items() if name not in ("means_t2", "quats_t2", "scales_t2")}
    v = torch.tensor(np.random.default_rng(0).standard_normal((1, 24, 32, 2)))
    exact = drawn_by_reference(exact_given)
    v = v * exact["sure"][..., None]
    (exact["flow"] * v).sum().backward()
    (drawn_by_gflow(given)[0]["flow"] * v.float()).sum().backward()
    for name in ("means", "quats", "scales", "move", "move_t2"):
        error = (actual_leaves[name].grad - exact_leaves[name].grad).norm() / exact_leaves[name].grad.norm()
        assert error < 2e-5, name


def test_backward_twice_and_unused_images():
    tensors, given = leaves(without_motion(scene()) | {"viewmats_t2": scene()["viewmats_t2"]}, torch.float32)
    images, _ = drawn_by_gflow(given, render_mode="RGB")
    images["rgb"].sum().backward(retain_graph=True)
    once = tensors["means"].grad.clone()
    images["rgb"].sum().backward()
    torch.testing.assert_close(tensors["means"].grad, 2 * once, rtol=1e-6, atol=0)


def test_double_tensors_have_double_gradients():
    tensors, given = leaves(without_motion(scene()) | {"viewmats_t2": scene()["viewmats_t2"]}, torch.float64)
    images, _ = drawn_by_gflow(given)
    images["rgb"].sum().backward()
    assert images["rgb"].dtype == torch.float64 and tensors["means"].grad.dtype == torch.float64


def test_density_control_finds_the_gradient_of_the_centres():
    tensors, given = leaves(scene(), torch.float32)
    images, meta = drawn_by_gflow(given)
    meta["means2d"].retain_grad()  # as with gsplat; does nothing here
    images["rgb"][0, :, :16].sum().backward()
    double = {name: torch.tensor(array) for name, array in scene().items()}
    offset = torch.zeros(14, 2, dtype=torch.float64, requires_grad=True)
    project = reference.project
    try:
        reference.project = lambda means, *rest: (lambda c, m, z: (c + offset, m, z))(*project(means, *rest))
        view = reference.render(one_view({k: v for k, v in double.items()}, 0, lambda t: t), SIZE)
    finally:
        reference.project = project
    view["rgb"][:, :16].sum().backward()
    error = (meta["means2d"].grad[0] - offset.grad).norm() / offset.grad.norm()
    assert error < 1e-4


def test_without_gradients_nothing_is_kept():
    _, given = leaves(scene(), torch.float32)
    with torch.no_grad():
        images, meta = drawn_by_gflow(given)
    assert not images["rgb"].requires_grad and not meta["means2d"].requires_grad


def test_what_has_no_gradient_is_refused():
    _, given = leaves(scene(), torch.float32)
    given["Ks"] = given["Ks"].requires_grad_()
    with pytest.raises(TypeError, match="'Ks' requires a gradient, but gflow has none by the intrinsics"):
        drawn_by_gflow(given)


def test_what_a_caller_does_to_alphas_leaves_the_gradient_of_backgrounds():
    def gradient(change):
        s = {name: torch.tensor(array) for name, array in single(without_motion(scene())).items()}
        s["backgrounds"].requires_grad_()
        colors, alphas, _ = gflow.torch.rasterization(**s, width=SIZE[0], height=SIZE[1])
        if change:
            alphas.detach().clamp_(max=0.01)
        colors.sum().backward()
        return s["backgrounds"].grad

    torch.testing.assert_close(gradient(True), gradient(False))
