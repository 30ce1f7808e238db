# SPDX-License-Identifier: Apache-2.0
"""Images of gflow.rasterization against double precision."""
import os

import numpy as np
import pytest
from scenes import SIZE, one_view, scene, single, without_motion

import gflow

torch = pytest.importorskip("torch")
import reference  # noqa: E402

ORACLE = os.path.join(os.path.dirname(__file__), "../data/oracle")


def expected(s, camera=0, **options):
    double = one_view(s, camera, lambda array: torch.tensor(array))
    return {name: value.numpy() for name, value in reference.render(double, SIZE, **options).items()}


def worst(actual, exact, sure):
    assert sure.mean() > 0.9
    return np.abs(actual.squeeze() - exact)[sure].max()


# Float32 keeps 24 bits; a pixel sums ten Gaussians, and distances are 10 px in splats of a few px.
@pytest.mark.parametrize("transport", ["material", "paper", "ot", "translate"])
@pytest.mark.parametrize("stop", ["exclude", "include"])
def test_colour_alpha_depth_and_flow_are_the_reference(transport, stop):
    s = scene(cameras=2)
    colors, alphas, meta = gflow.rasterization(**single(s), width=SIZE[0], height=SIZE[1], render_mode="RGB+D",
                                               transport=transport, stop=stop)
    assert colors.shape == (2, 24, 32, 4) and alphas.shape == (2, 24, 32, 1) and meta["flow"].shape == (2, 24, 32, 2)
    for camera in range(2):
        exact = expected(s, camera, transport=transport, stop=stop)
        assert worst(colors[camera, ..., :3], exact["rgb"], exact["sure"]) < 2e-6
        assert worst(alphas[camera], exact["alpha"], exact["sure"]) < 2e-6
        assert worst(meta["depth"][camera], exact["depth"], exact["sure"]) < 1e-5
        assert worst(meta["flow"][camera], exact["flow"], exact["sure"]) < 5e-5


def test_saturated_pixels_end_by_the_rule():
    s = scene(n=40)
    s["opacities"][:] = 0.95
    s["scales"] *= 2
    images = {}
    for stop in ("exclude", "include"):
        images[stop] = gflow.rasterization(**single(without_motion(s)), width=SIZE[0], height=SIZE[1], stop=stop)[0][0]
        exact = expected(s, stop=stop)
        assert worst(images[stop], exact["rgb"], exact["sure"]) < 2e-6
    assert np.abs(images["exclude"] - images["include"]).max() > 1e-5


def test_flow_of_the_first_gaussians():
    s = scene(n=30)
    meta = gflow.rasterization(**single(s), width=SIZE[0], height=SIZE[1], top_k=2)[2]
    exact = expected(s, top_k=2)
    assert worst(meta["flow"][0], exact["flow"], exact["sure"]) < 5e-5


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_spherical_harmonics(degree):
    s = scene(sh_degree=3)  # more coefficients than are used
    colors = gflow.rasterization(**single(s), width=SIZE[0], height=SIZE[1], sh_degree=degree)[0]
    exact = expected(s, sh_degree=degree)
    assert worst(colors[0], exact["rgb"], exact["sure"]) < 2e-6


def test_render_modes():
    s = single(scene())
    views = {mode: gflow.rasterization(**s, width=SIZE[0], height=SIZE[1], render_mode=mode)
             for mode in ("RGB", "D", "ED", "RGB+D", "RGB+ED")}
    assert [views[mode][0].shape[-1] for mode in views] == [3, 1, 1, 4, 4]
    depth, alphas = views["D"][0], views["D"][1]
    np.testing.assert_array_equal(views["RGB+D"][0][..., 3:], depth)
    np.testing.assert_array_equal(views["RGB+D"][0][..., :3], views["RGB"][0])
    np.testing.assert_allclose(views["ED"][0], depth / np.maximum(alphas, 1e-10), rtol=1e-6)
    np.testing.assert_array_equal(views["RGB+ED"][2]["depth"], views["ED"][0])
    assert "depth" not in views["RGB"][2]


def test_meta_describes_the_projected_gaussians():
    s = scene(cameras=2)
    meta = gflow.rasterization(**single(without_motion(s)), width=SIZE[0], height=SIZE[1])[2]
    assert "flow" not in meta and (meta["width"], meta["height"], meta["n_cameras"]) == (*SIZE, 2)
    exact = expected(s, 1)
    seen = meta["radii"][1, :, 0] > 0
    assert seen.sum() > 10
    np.testing.assert_allclose(meta["means2d"][1][seen], exact["means2d"][seen], atol=1e-4)
    np.testing.assert_allclose(meta["depths"][1][seen], exact["depths"][seen], rtol=1e-6)
    inverse = np.linalg.inv(exact["covariance"])
    np.testing.assert_allclose(meta["conics"][1][seen], np.stack([inverse[:, 0, 0], inverse[:, 0, 1], inverse[:, 1, 1]],
                                                                 -1)[seen], rtol=1e-4, atol=1e-6)
    reach = 2 * np.log(255 * s["opacities"])
    half = np.sqrt(reach[:, None] * exact["covariance"][:, [0, 1], [0, 1]])
    np.testing.assert_array_equal(meta["radii"][1][seen], np.ceil(half)[seen])
    np.testing.assert_array_equal(meta["opacities"][1], np.float32(s["opacities"]))
    assert (meta["tiles_per_gauss"] > 0).sum() == (meta["radii"][..., 0] > 0).sum()


def test_each_camera_of_a_batch_is_as_alone():
    s = single(scene(cameras=3))
    together = gflow.rasterization(**s, width=SIZE[0], height=SIZE[1])
    for c in range(3):
        own = {k: v[c:c + 1] if k in ("viewmats", "viewmats_t2", "Ks", "backgrounds") else v for k, v in s.items()}
        alone = gflow.rasterization(**own, width=SIZE[0], height=SIZE[1])
        np.testing.assert_array_equal(together[0][c], alone[0][0])
        np.testing.assert_array_equal(together[2]["flow"][c], alone[2]["flow"][0])


def test_colours_of_each_camera():
    s = single(without_motion(scene(cameras=2)))
    other = s["colors"][::-1]
    both = gflow.rasterization(**{**s, "colors": np.stack([s["colors"], other])}, width=SIZE[0], height=SIZE[1])[0]
    np.testing.assert_array_equal(both[0], gflow.rasterization(**s, width=SIZE[0], height=SIZE[1])[0][0])
    np.testing.assert_array_equal(both[1], gflow.rasterization(**{**s, "colors": other}, width=SIZE[0],
                                                               height=SIZE[1])[0][1])


def test_what_does_not_move_need_not_be_given():
    s = scene()
    still = {**s, **{name + "_t2": s[name] for name in ("means", "quats", "scales")}}
    fully = gflow.rasterization(**single(still), width=SIZE[0], height=SIZE[1])[2]["flow"]
    camera_only = {**without_motion(s), "viewmats_t2": s["viewmats_t2"]}
    shortly = gflow.rasterization(**single(camera_only), width=SIZE[0], height=SIZE[1])[2]["flow"]
    np.testing.assert_array_equal(fully, shortly)
    assert np.abs(shortly).max() > 0.1


def test_no_gaussians_leave_the_background():
    s = {name: array[:0] if name not in ("viewmats", "Ks", "backgrounds") else array
         for name, array in single(without_motion(scene())).items()}
    colors, alphas, meta = gflow.rasterization(**s, width=SIZE[0], height=SIZE[1])
    np.testing.assert_array_equal(colors[0], np.broadcast_to(s["backgrounds"][0], (24, 32, 3)))
    assert not alphas.any() and meta["radii"].shape == (1, 0, 2)


@pytest.mark.parametrize("name", ["small_material", "small_paper"])
def test_oracle(name):
    with np.load(os.path.join(ORACLE, name + ".npz")) as file:
        s = dict(file)
    width, height = (int(side) for side in s["size"])
    names = [n for n in ("means", "quats", "scales", "opacities", "colors", "means_t2", "quats_t2", "scales_t2")]
    batch = {n: s[o][None] for n, o in {"viewmats": "viewmat", "viewmats_t2": "viewmat_t2", "Ks": "K",
                                        "backgrounds": "background"}.items()}
    colors, alphas, meta = gflow.rasterization(**{n: s[n] for n in names}, **batch, width=width, height=height,
                                               render_mode="RGB+D", transport=name[6:], stop="include")
    sure = s["mask"] > 0
    assert np.abs(colors[0, ..., :3] - s["rgb"])[sure].max() < 5e-6
    assert np.abs(alphas[0, ..., 0] - s["alpha"])[sure].max() < 5e-6
    assert np.abs(meta["depth"][0, ..., 0] - s["depth"])[sure].max() < 5e-6 * np.abs(s["depth"]).max()
    assert np.abs(meta["flow"][0] - s["flow"])[sure].max() < 1e-4
