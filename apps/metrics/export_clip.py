#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes the image encoder of CLIP as an ONNX file that gflow evaluates with: metrics.clip = "clip.onnx".

    pip install torch transformers onnx
    python3 export_clip.py clip.onnx                # ViT-B/32
    python3 export_clip.py clip.onnx --model openai/clip-vit-large-patch14

The weights are loaded by the package `transformers` (CLIPVisionModelWithProjection), from the network
when used first, or from a folder that --model names. The arithmetic is that model's, written with
matrices of two dimensions only, since OpenCV 4.6 can neither broadcast nor multiply more. The script
compares both before it writes, and with OpenCV where cv2 is installed.
"""
import argparse
import functools
import sys


def needed(name):
    try:
        return __import__(name)
    except ImportError as problem:
        sys.exit(f"export_clip.py needs the package '{name}': {problem}; "
                 "pip install torch transformers onnx")


torch = needed("torch")
transformers = needed("transformers")


def linear(weights, bias=None):
    """x [rows, from] -> x W^T + b [rows, to], for weights W [to, from]."""
    out = torch.nn.Linear(weights.shape[1], weights.shape[0], bias=bias is not None)
    out.weight.data = weights.detach().clone()
    if bias is not None:
        out.bias.data = bias.detach().clone()
    return out


@functools.lru_cache(None)
def centre_and_mean(n):
    """Of rows of n, in each column. OpenCV 4.6 wants equal weights but once in a file, hence one
    bias of zeros for both."""
    matrix = torch.full((n, n), 1 / n)
    centre, mean = (linear(m, torch.zeros(n)) for m in (torch.eye(n) - matrix, matrix))
    mean.bias = centre.bias
    return centre, mean


class Norm(torch.nn.Module):
    """Layer normalisation of rows."""

    def __init__(self, norm):
        super().__init__()
        self.centre, self.mean = centre_and_mean(norm.weight.shape[0])
        self.affine = linear(torch.diag(norm.weight), norm.bias)
        self.eps = norm.eps

    def forward(self, x):
        x = self.centre(x)
        return self.affine(x / torch.sqrt(self.mean(x * x) + self.eps))


class Attention(torch.nn.Module):
    """One head after the other."""

    def __init__(self, attention, heads):
        super().__init__()
        size = attention.q_proj.weight.shape[0] // heads
        parts = [slice(h * size, (h + 1) * size) for h in range(heads)]
        rows = lambda p, scale: torch.nn.ModuleList(
            linear(scale * p.weight[s], scale * p.bias[s]) for s in parts)
        self.q = rows(attention.q_proj, size ** -0.5)
        self.k, self.v = rows(attention.k_proj, 1), rows(attention.v_proj, 1)
        out = attention.out_proj
        self.out = torch.nn.ModuleList(
            linear(out.weight[:, s], out.bias if s.start == 0 else None) for s in parts)

    def forward(self, x):
        total = 0
        for q, k, v, out in zip(self.q, self.k, self.v, self.out):
            weights = torch.softmax(torch.matmul(q(x), k(x).transpose(0, 1)), dim=1)
            total = total + out(torch.matmul(weights, v(x)))
        return total


class Layer(torch.nn.Module):
    def __init__(self, layer, heads):
        super().__init__()
        self.norm1, self.norm2 = Norm(layer.layer_norm1), Norm(layer.layer_norm2)
        self.attention = Attention(layer.self_attn, heads)
        self.fc1, self.fc2 = (linear(f.weight, f.bias) for f in (layer.mlp.fc1, layer.mlp.fc2))

    def forward(self, x):
        x = x + self.attention(self.norm1(x))
        inner = self.fc1(self.norm2(x))
        return x + self.fc2(inner * torch.sigmoid(1.702 * inner))


class Encoder(torch.nn.Module):
    """An image as clip_input makes it [1, 3, S, S] -> its embedding [1, n]."""

    def __init__(self, model):
        super().__init__()
        config, vision = model.config, model.vision_model
        if config.hidden_act != "quick_gelu":
            sys.exit(f"export_clip.py supports quick_gelu only; this model uses {config.hidden_act}")
        embeddings = vision.embeddings
        self.patches = embeddings.patch_embedding
        self.width, self.count = config.hidden_size, (config.image_size // config.patch_size) ** 2
        # The patches become columns 1, 2, ...; column 0 is the class. Then all become rows and get
        # their positions. (A transposition just before a matrix with a bias would become one with
        # a flag that OpenCV 4.6 passes over.)
        self.places = linear(torch.eye(self.count + 1)[:, 1:])
        start = embeddings.position_embedding.weight.detach().clone()
        start[0] += embeddings.class_embedding.detach()
        self.register_buffer("start", start)
        self.first = linear(torch.eye(self.count + 1)[:1])
        self.pre, self.post = Norm(vision.pre_layrnorm), Norm(vision.post_layernorm)
        self.layers = torch.nn.ModuleList(
            Layer(layer, config.num_attention_heads) for layer in vision.encoder.layers)
        self.projection = linear(model.visual_projection.weight)

    def forward(self, image):
        columns = self.patches(image).reshape(self.width, self.count)
        x = self.pre(self.places(columns).transpose(0, 1) + self.start)
        for layer in self.layers:
            x = layer(x)
        x = self.projection(self.post(x))
        return self.first(x.transpose(0, 1)).reshape(1, -1)


def by_opencv(path, image):
    try:
        import cv2
    except ImportError:
        return None
    net = cv2.dnn.readNetFromONNX(path)
    net.setInput(image.numpy())
    return torch.from_numpy(net.forward().reshape(-1))


def main():
    parser = argparse.ArgumentParser(description="CLIP's image encoder as an ONNX file for gflow")
    parser.add_argument("output", help="output file, .onnx")
    parser.add_argument("--model", default="openai/clip-vit-base-patch32", help="name or folder")
    arguments = parser.parse_args()
    model = transformers.CLIPVisionModelWithProjection.from_pretrained(arguments.model).eval()
    encoder = Encoder(model).eval()
    side = model.config.image_size
    image = torch.randn(1, 3, side, side)
    with torch.no_grad():
        theirs = model(pixel_values=image).image_embeds.reshape(-1)
        far = float((encoder(image).reshape(-1) - theirs).norm() / theirs.norm())
        if far > 1e-4:
            sys.exit(f"the relative error of the export would be {far:.1e}: nothing was written")
        torch.onnx.export(encoder, image, arguments.output, input_names=["picture"],
                          output_names=["embedding"], opset_version=11)
    opencv = by_opencv(arguments.output, image)
    print(f"{arguments.output}: relative error {far:.1e} here, in OpenCV "
          + ("not tested (no cv2)" if opencv is None
             else f"{float((opencv - theirs).norm() / theirs.norm()):.1e}"))


if __name__ == "__main__":
    main()
