#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Guidance by Zero123 (Liu et al. 2023): score distillation in the latents of a diffusion model
that knows the object from the reference image and the view from its pose.

    example_zero123.py MODEL [--scale 5] [--device cuda] [--resolution 256]

MODEL is a folder, or a name that huggingface_hub has in its cache, in the layout of
ashawkey/zero123-xl-diffusers (not of stable-zero123, whose pose is another): vae/, unet/, image_encoder/, clip_camera_projection/, scheduler/.
Nothing is downloaded unless --download is given. Needs torch, diffusers and transformers:

    pip install torch diffusers transformers safetensors

gflow's settings for it: guidance.size = 256, a square that the model was made for; guidance.weight is
to be found for each scene, since the gradient is a sum over latents. The steps are those of
DreamGaussian (Tang et al. 2023): timestep as gflow drew it, w(t) = 1 - alpha_bar, classifier-free
guidance, the gradient of the latents through the encoder.
"""
import argparse
import math
import os

from gflow_guidance import Answer, fail, serve

try:
    import torch
    import torch.nn.functional as F
    from diffusers import AutoencoderKL, DDIMScheduler, UNet2DConditionModel
    from transformers import CLIPVisionModelWithProjection
except ImportError as problem:
    fail(
        f"Zero123 needs {problem.name}, which is not installed: "
        "pip install torch diffusers transformers safetensors"
    )

# Of the images CLIP was trained with.
CLIP_MEAN = (0.48145466, 0.4578275, 0.40821073)
CLIP_STD = (0.26862954, 0.26130258, 0.27577711)


def parts_folder(model, download):
    """The folder that holds the model's parts; ends the program where there are no weights."""
    if os.path.isdir(model):
        return model
    try:
        from huggingface_hub import snapshot_download

        return snapshot_download(model, local_files_only=not download)
    except Exception as problem:
        fail(
            f"cannot find the weights of {model}: it is not a folder, and "
            + ("downloading it failed" if download else "not in huggingface_hub's cache; "
               "--download fetches it")
            + f" ({type(problem).__name__})"
        )


def projection_of(folder, device, dtype):
    """The layer that joins CLIP's image of the reference, 768 numbers, with the pose, 4."""
    folder = os.path.join(folder, "clip_camera_projection")
    safe = os.path.join(folder, "diffusion_pytorch_model.safetensors")
    if os.path.isfile(safe):
        from safetensors.torch import load_file

        weights = load_file(safe)
    else:
        path = os.path.join(folder, "diffusion_pytorch_model.bin")
        weights = torch.load(path, map_location="cpu", weights_only=True)
    weight = weights["proj.weight"]
    layer = torch.nn.Linear(weight.shape[1], weight.shape[0])
    layer.load_state_dict({"weight": weight, "bias": weights["proj.bias"]})
    return layer.to(device, dtype).requires_grad_(False)


class Zero123:
    def __init__(self, folder, scale, device, resolution):
        self.scale, self.device, self.resolution = scale, device, resolution
        self.dtype = torch.float16 if device.startswith("cuda") else torch.float32

        def part(kind, name):
            loaded = kind.from_pretrained(folder, subfolder=name, torch_dtype=self.dtype)
            return loaded.to(device).requires_grad_(False).eval()

        self.vae = part(AutoencoderKL, "vae")
        self.unet = part(UNet2DConditionModel, "unet")
        self.encoder = part(CLIPVisionModelWithProjection, "image_encoder")
        self.projection = projection_of(folder, device, self.dtype)
        scheduler = DDIMScheduler.from_pretrained(folder, subfolder="scheduler")
        self.alphas = scheduler.alphas_cumprod.to(device)

    def square(self, image, size, background):
        """[1, 3, size, size] of planes [3, H, W], the whole image in the middle."""
        height, width = image.shape[1:]
        most = max(height, width)
        canvas = background.view(3, 1, 1).expand(3, most, most).clone()
        top, left = (most - height) // 2, (most - width) // 2
        canvas[:, top : top + height, left : left + width] = image
        return F.interpolate(canvas[None], (size, size), mode="bilinear", antialias=most > size)

    def latents(self, image):
        posterior = self.vae.encode((2 * image - 1).to(self.dtype)).latent_dist
        return posterior.mode() * self.vae.config.scaling_factor

    @torch.no_grad()
    def conditions(self, request, background):
        rgb = torch.from_numpy(request.reference.rgb).to(self.device)
        seen = self.square(rgb, self.resolution, background)
        mean = torch.tensor(CLIP_MEAN, device=self.device).view(1, 3, 1, 1)
        std = torch.tensor(CLIP_STD, device=self.device).view(1, 3, 1, 1)
        small = F.interpolate(seen, (224, 224), mode="bicubic", antialias=True).clamp(0, 1)
        clip = self.encoder(((small - mean) / std).to(self.dtype)).image_embeds
        return clip, self.latents(seen) / self.vae.config.scaling_factor

    @torch.no_grad()
    def noise_seen(self, noisy, t, view, clip, image):
        azimuth = math.radians(view.azimuth)
        pose = [math.radians(-view.elevation), math.sin(azimuth), math.cos(azimuth), view.distance]
        pose = torch.tensor([pose], device=self.device, dtype=self.dtype)
        words = self.projection(torch.cat([clip, pose], 1))[:, None]
        words = torch.cat([torch.zeros_like(words), words])
        images = torch.cat([torch.zeros_like(image), image])
        inputs = torch.cat([torch.cat([noisy] * 2), images], 1)
        times = torch.full((2,), t, device=self.device)
        noise = self.unet(inputs, times, encoder_hidden_states=words).sample
        without, given = noise.chunk(2)
        return without + self.scale * (given - without)

    def guide(self, request):
        background = torch.from_numpy(request.background).to(self.device)
        clip, image = self.conditions(request, background)
        return [
            self.answer(request, i, view, clip, image, background)
            for i, view in enumerate(request.views)
        ]

    def answer(self, request, i, view, clip, image, background):
        rgb = torch.from_numpy(view.rgb).to(self.device).requires_grad_()
        latents = self.latents(self.square(rgb, self.resolution, background))
        t = min(int(round(view.timestep * len(self.alphas))), len(self.alphas) - 1)
        alpha_bar = self.alphas[t]
        lots = torch.Generator().manual_seed(request.seed * 64 + i)
        noise = torch.randn(latents.shape, generator=lots).to(self.device, self.dtype)
        with torch.no_grad():
            noisy = alpha_bar.sqrt() * latents + (1 - alpha_bar).sqrt() * noise
            seen = self.noise_seen(noisy.to(self.dtype), t, view, clip, image)
            gradient = torch.nan_to_num((1 - alpha_bar) * (seen - noise).float())
        latents.backward(gradient.to(latents.dtype))
        return Answer(gradient=rgb.grad.float().cpu().numpy())


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Zero123 as a guidance program of gflow")
    parser.add_argument("model")
    parser.add_argument("--scale", type=float, default=5, help="scale of classifier-free guidance")
    parser.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    parser.add_argument("--resolution", type=int, default=256)
    parser.add_argument("--download", action="store_true")
    options = parser.parse_args()
    parts = parts_folder(options.model, options.download)
    try:
        provider = Zero123(parts, options.scale, options.device, options.resolution)
    except (OSError, KeyError, RuntimeError) as problem:
        fail(f"cannot load {options.model}: {problem}")
    serve(provider.guide)
