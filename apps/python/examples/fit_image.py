#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Fits flat Gaussians to an image by gradient descent: fit_image.py [image [steps]]; without one, to one of its own."""
import sys

import numpy as np
import torch

import gflow.torch

if len(sys.argv) > 1:
    from PIL import Image
    image = torch.tensor(np.array(Image.open(sys.argv[1]).convert("RGB")) / 255, dtype=torch.float32)
else:
    y, x = torch.meshgrid(torch.linspace(-1, 1, 64), torch.linspace(-1.5, 1.5, 96), indexing="ij")
    image = torch.stack([(x * x + y * y < 0.6).float(), 0.5 + 0.5 * torch.sin(4 * x), 0.5 - 0.4 * y], -1)
(height, width), n = image.shape[:2], 1000
torch.manual_seed(0)
place = (torch.rand(n, 2) - 0.5) * torch.tensor([1, height / width])  # at z = 1; the image is 1 wide there
size = torch.full((n, 3), np.log(0.7 / n**0.5))  # logarithms
turn, opacity, color = torch.randn(n, 4), torch.zeros(n), torch.rand(n, 3)  # opacities: logits
K = torch.tensor([[[width, 0, width / 2], [0, width, height / 2], [0, 0, 1.0]]])
rates = {place: 2e-3, size: 2e-2, turn: 2e-2, opacity: 5e-2, color: 2e-2}
adam = torch.optim.Adam([{"params": p.requires_grad_(), "lr": rate} for p, rate in rates.items()])
for step in range(int(sys.argv[2]) if len(sys.argv) > 2 else 200):
    drawn, _, _ = gflow.torch.rasterization(torch.cat([place, torch.ones(n, 1)], 1), turn, size.exp(),
                                            opacity.sigmoid(), color, torch.eye(4)[None], K, width, height)
    loss = ((drawn[0] - image) ** 2).mean()
    adam.zero_grad()
    loss.backward()
    adam.step()
    if step % 50 == 49:
        print(f"step {step + 1}: {-10 * loss.log10():.1f} dB", flush=True)
