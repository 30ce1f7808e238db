# SPDX-License-Identifier: Apache-2.0
"""A few random Gaussians that move, in front of cameras that move."""
import numpy as np

SIZE = (32, 24)  # width, height


def turned(axis, angle):
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def viewmat(axis, angle, translation):
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turned(axis, angle), translation
    return pose


def scene(n=14, seed=1, sh_degree=None, cameras=1):
    """Double arrays, named as the arguments of rasterization(), that are the same in float32."""
    random = np.random.default_rng(seed)
    means = random.uniform([-1.2, -0.9, 3], [1.2, 0.9, 6], (n, 3))
    colors = random.uniform(0, 1, (n, 3))
    if sh_degree is not None:
        colors = 0.4 * random.standard_normal((n, (sh_degree + 1)**2, 3))
        colors[:, 0] += 0.5
    quats, scales = random.standard_normal((n, 4)), random.uniform(0.1, 0.6, (n, 3))
    views = [viewmat([1, 2, 0.5 + c], 0.1 + 0.05 * c, [0.1, -0.1, 0.2 * c]) for c in range(cameras)]
    K = np.array([[30, 0, SIZE[0] / 2 + 0.7], [0, 33, SIZE[1] / 2 - 0.4], [0, 0, 1]])
    made = {"means": means, "quats": quats, "scales": scales, "opacities": random.uniform(0.2, 1, n), "colors": colors,
            "viewmats": np.stack(views), "Ks": np.stack([K] * cameras),
            "backgrounds": random.uniform(0, 1, (cameras, 3)),
            "means_t2": means + 0.1 * random.standard_normal((n, 3)),
            "quats_t2": quats + 0.1 * random.standard_normal((n, 4)),
            "scales_t2": scales * random.uniform(0.9, 1.1, (n, 3)),
            "viewmats_t2": np.stack([viewmat([0, 1, 0], 0.02, [0.05, 0, 0.1]) @ view for view in views])}
    return {name: array.astype(np.float32).astype(np.float64) for name, array in made.items()}


STATIC = ("means", "quats", "scales", "opacities", "colors", "viewmats", "Ks")
MOTION = ("means_t2", "quats_t2", "scales_t2", "viewmats_t2")


def without_motion(s):
    return {name: array for name, array in s.items() if name not in MOTION}


def single(s, dtype=np.float32):
    return {name: array.astype(dtype) for name, array in s.items()}


def one_view(s, camera, tensor):
    """The scene of the reference: what one camera sees, by `tensor` of each array."""
    per_camera = {"viewmats": "viewmat", "viewmats_t2": "viewmat_t2", "Ks": "K", "backgrounds": "background"}
    return {per_camera.get(name, name): tensor(array)[camera] if name in per_camera else tensor(array)
            for name, array in s.items()}
