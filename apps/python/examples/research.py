#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A motion model and a loss of your own: research.py [scene [steps [picture.png]]].

Notebook-like: each `# %%` is a cell. Needs PyTorch; to write the picture, OpenCV's Python module (python3-opencv).
"""
# %% A scene: cameras and images at times, half their size
import os
import sys

import numpy as np
import torch

import gflow
import gflow.torch

here = os.path.dirname(os.path.abspath(__file__))
path = sys.argv[1] if sys.argv[1:] and sys.argv[1] else os.path.join(here, "..", "..", "demo", "scene")
steps = int(sys.argv[2]) if len(sys.argv) > 2 else 1500
scene = gflow.Scene(path, resolution=2)
views = {(view.track, view.step): view for view in scene.train}
print(scene)

# %% A motion model in PyTorch: the path of each Gaussian is a sum of a few waves in time
torch.manual_seed(0)
points, colors = scene.points
n, waves = len(points), torch.arange(1, 4) * np.pi
parameters = {
    "means": (torch.tensor(points, dtype=torch.float32), 2e-3),
    "paths": (torch.zeros(n, 3, 2 * len(waves)), 3e-3),
    "quats": (torch.tensor([1.0, 0, 0, 0]).repeat(n, 1), 2e-3),
    "scales": (torch.full((n, 3), np.log(0.03 * scene.extent)), 1e-2),  # logarithms
    "opacities": (torch.zeros(n), 5e-2),  # logits
    "colors": (torch.tensor(colors / 255, dtype=torch.float32), 1e-2)}
p = {name: tensor.requires_grad_() for name, (tensor, _) in parameters.items()}
adam = torch.optim.Adam([{"params": tensor, "lr": rate} for tensor, rate in parameters.values()])


def means_at(t):
    return p["means"] + p["paths"] @ torch.cat([torch.cos(waves * t), torch.sin(waves * t)])


def drawn(view, next_view):
    camera = view.camera
    return gflow.torch.rasterization(
        means_at(view.time), p["quats"], p["scales"].exp(), p["opacities"].sigmoid(), p["colors"],
        torch.tensor(camera.viewmat[None]).float(), torch.tensor(camera.K[None]).float(), camera.width, camera.height,
        near_plane=scene.near_plane, backgrounds=torch.ones(1, 3), means_t2=means_at(next_view.time))


# %% Target flow between neighbouring images
def tensor_of(view):
    return torch.tensor(view.image()[..., :3] / 255).float()


flows = {key: gflow.optical_flow(view.image()[..., :3], views[key[0], key[1] + 1].image()[..., :3])
         for key, view in views.items() if (key[0], key[1] + 1) in views}
keys = sorted(flows)

# %% Images and flow supervise the paths together
for step in range(steps):
    key = keys[np.random.default_rng(step).integers(len(keys))]
    view, next_view = views[key], views[key[0], key[1] + 1]
    image, _, meta = drawn(view, next_view)
    flow, consistent = (torch.tensor(array) for array in flows[key])
    flow_loss = ((meta["flow"][0] - flow).abs().sum(-1) * consistent).mean()
    loss = (image[0] - tensor_of(view)).abs().mean() + 0.02 * flow_loss
    adam.zero_grad()
    loss.backward()
    adam.step()
    if step % 100 == 99:
        psnr = -10 * torch.log10(((image[0] - tensor_of(view)) ** 2).mean())
        print(f"own motion, step {step + 1}: {psnr:.1f} dB, flow {flow_loss:.2f} px", flush=True)


# %% A loss of your own inside of gflow's training: image gradients, differentiated by PyTorch
class Edges(gflow.Objective):
    name = "edges"

    def __call__(self, view):
        image = torch.tensor(view.colors, requires_grad=True)
        truth = torch.tensor(view.truth)
        loss = sum((image.diff(dim=d) - truth.diff(dim=d)).abs().mean() for d in (0, 1)) * view.share
        loss.backward()
        return loss.item(), {"colors": image.grad.numpy()}


def callback(state):
    print(f"own loss, step {state.step}: {state.terms['psnr']:.1f} dB, edges {state.terms['edges']:.4f}", flush=True)


model = gflow.train(scene, iterations=steps, objectives=[Edges()], callback=callback, every=max(steps // 3, 1),
                    quiet=True).model

# %% A held-out view: truth, own motion, its flow, gflow with the own loss, its flow
held = scene.test or scene.train
view = held[len(held) // 2]
later = next((other for other in held if other.track == view.track and other.step == view.step + 1), view)
with torch.no_grad():
    own, _, meta = drawn(view, later)
trained = model.render(view.camera, view.time, later.time)
for name, image in (("own motion", own[0].numpy()), ("own loss", trained.colors)):
    error = np.mean((np.clip(image, 0, 1) - view.image()[..., :3] / 255) ** 2)
    print(f"{name}, held-out view {view.name}: {-10 * np.log10(error):.1f} dB")

if len(sys.argv) > 3:
    import cv2

    def wheel(flow):  # direction is hue, length is saturation
        angle, length = np.arctan2(flow[..., 1], flow[..., 0]), np.hypot(flow[..., 0], flow[..., 1])
        hsv = np.stack([angle / np.pi * 90 + 90, 255 * np.minimum(length / 3, 1), np.full(length.shape, 255)], -1)
        return cv2.cvtColor(hsv.astype(np.uint8), cv2.COLOR_HSV2RGB)

    def bytes_of(image):
        return (np.clip(image, 0, 1) * 255).astype(np.uint8)

    row = np.hstack([view.image()[..., :3], bytes_of(own[0].numpy()), wheel(meta["flow"][0].numpy()),
                     trained.image(), wheel(trained.flow)])
    row = cv2.resize(row, None, fx=3, fy=3, interpolation=cv2.INTER_NEAREST)
    cv2.imwrite(sys.argv[3], row[..., ::-1])
