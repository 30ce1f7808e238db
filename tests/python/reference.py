# SPDX-License-Identifier: Apache-2.0
"""One view in double precision with derivatives by PyTorch: every Gaussian at every pixel, no tiles."""
import torch

DILATION = 0.3


def rotation_of(quats):
    w, x, y, z = torch.nn.functional.normalize(quats, dim=-1).unbind(-1)
    rows = [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
            2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
            2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]
    return torch.stack(rows, -1).reshape(-1, 3, 3)


def project(means, quats, scales, viewmat, K, size):
    """Centres [N, 2], factors M = J W R diag(s) [N, 2, 3], camera z [N]."""
    points = means @ viewmat[:3, :3].T + viewmat[:3, 3]
    z = points[:, 2]
    slopes = points[:, :2] / z[:, None]
    focal, centre = torch.stack([K[0, 0], K[1, 1]]), K[:2, 2]
    sides = torch.tensor(size, dtype=torch.float64)
    margin = 0.3 * sides / 2 / focal
    bounded = torch.minimum(torch.maximum(slopes, -centre / focal - margin), (sides - centre) / focal + margin)
    jacobian = torch.cat([torch.diag_embed(focal / z[:, None]), (-focal * bounded / z[:, None])[..., None]], -1)
    factors = jacobian @ viewmat[:3, :3] @ (rotation_of(quats) * scales[:, None])
    return slopes * focal + centre, factors, z


def covariance(factors):
    return factors @ factors.mT + DILATION * torch.eye(2, dtype=torch.float64)


def root(matrices):
    """Symmetric square roots of 2 x 2 matrices, by Cayley-Hamilton."""
    s = torch.linalg.det(matrices).sqrt()
    trace = matrices.diagonal(dim1=-2, dim2=-1).sum(-1)
    eye = torch.eye(2, dtype=torch.float64)
    return (matrices + s[:, None, None] * eye) / (trace + 2 * s).sqrt()[:, None, None]


def transported(kind, m1, m2):
    """The affine map of the pixels under each Gaussian, without the identity [N, 2, 2]."""
    s1, s2 = covariance(m1), covariance(m2)
    eye = torch.eye(2, dtype=torch.float64)
    if kind == "translate":
        return torch.zeros_like(s1)
    if kind == "material":
        return (m2 - m1) @ m1.mT @ torch.linalg.inv(s1)
    if kind == "paper":
        return root(s2) @ torch.linalg.inv(root(s1)) - eye
    b1 = root(s1)  # ot: the Monge map inv(B1) (B1 S2 B1)^(1/2) inv(B1)
    return torch.linalg.inv(b1) @ root(b1 @ s2 @ b1) @ torch.linalg.inv(b1) - eye


def harmonics(degree, d):
    """Real spherical harmonics in directions d [N, 3], in the order of 3DGS files [N, (degree + 1)^2]."""
    x, y, z = d.unbind(-1)
    pi = torch.pi
    bands = [torch.full_like(x, 0.5 / pi**0.5)]
    if degree > 0:
        bands += [(3 / (4 * pi))**0.5 * v for v in (-y, z, -x)]
    if degree > 1:
        c = 0.5 * (15 / pi)**0.5
        bands += [c * x * y, -c * y * z, 0.25 * (5 / pi)**0.5 * (3 * z * z - 1), -c * x * z, c / 2 * (x * x - y * y)]
    if degree > 2:
        c, e, f = 0.25 * (35 / (2 * pi))**0.5, 0.5 * (105 / pi)**0.5, 0.25 * (21 / (2 * pi))**0.5
        bands += [-c * y * (3 * x * x - y * y), e * x * y * z, -f * y * (5 * z * z - 1),
                  0.25 * (7 / pi)**0.5 * z * (5 * z * z - 3), -f * x * (5 * z * z - 1), e / 2 * z * (x * x - y * y),
                  -c * x * (x * x - 3 * y * y)]
    return torch.stack(bands, -1)


def seen_colors(colors, means, viewmat, degree):
    centre = -viewmat[:3, :3].T @ viewmat[:3, 3]
    directions = torch.nn.functional.normalize(means - centre, dim=-1)
    basis = harmonics(degree, directions)
    return ((basis[..., None] * colors[:, :basis.shape[1]]).sum(1) + 0.5).clamp_min(0)


def render(s, size, transport="material", stop="exclude", top_k=0, sh_degree=None):
    """Images of one view of the scene `s`, a dict of double tensors, and `sure`: pixels where float32 decides alike."""
    centre, m1, z = project(s["means"], s["quats"], s["scales"], s["viewmat"], s["K"], size)
    centre2, m2, _ = project(s["means_t2"], s["quats_t2"], s["scales_t2"], s["viewmat_t2"], s["K"], size)
    colors = s["colors"] if sh_degree is None else seen_colors(s["colors"], s["means"], s["viewmat"], sh_degree)
    order = torch.argsort(z.detach(), stable=True)
    width, height = size
    rows, columns = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
    pixels = torch.stack([columns, rows], -1).reshape(-1, 2).double() + 0.5
    d = pixels[:, None] - centre[order]
    inverse = torch.linalg.inv(covariance(m1))[order]
    raw = s["opacities"][order] * torch.exp(-0.5 * (d[..., None, :] @ inverse @ d[..., None])[..., 0, 0])
    raw = raw * (z[order] >= 0.01)
    alpha = torch.where(raw >= 1 / 255, raw.clamp_max(0.99), torch.zeros_like(raw))
    after = torch.cumprod(1 - alpha, 1)
    before = torch.cat([torch.ones_like(after[:, :1]), after[:, :-1]], 1)
    decides = after if stop == "exclude" else before
    drawn = (alpha > 0) & (decides >= 1e-4)
    weights = torch.where(drawn, alpha * before, torch.zeros_like(alpha))
    flow_weights = weights * (torch.cumsum(drawn.int(), 1) <= top_k) if top_k else weights
    total, flow_total = weights.sum(1), flow_weights.sum(1)
    motion = (transported(transport, m1, m2)[order] @ d[..., None])[..., 0] + (centre2 - centre)[order]
    flow = (flow_weights[..., None] * motion).sum(1) / flow_total.clamp_min(1e-300)[:, None]
    close = ((raw * 255 - 1).abs() < 1e-4) | ((decides / 1e-4 - 1).abs() < 1e-3) | ((raw / 0.99 - 1).abs() < 1e-5)
    image = lambda values: values.reshape(height, width, *values.shape[1:])
    return {"rgb": image(weights @ colors[order] + (1 - total)[:, None] * s["background"]), "alpha": image(total),
            "depth": image(weights @ z[order]), "flow": image(flow), "sure": image(~close.any(1)),
            "means2d": centre, "depths": z, "covariance": covariance(m1)}
