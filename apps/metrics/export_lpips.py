#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes LPIPS as an ONNX file that gflow evaluates with: metrics.lpips = "alex.onnx".

    pip install torch torchvision lpips onnx
    python3 export_lpips.py alex.onnx              # --net vgg: the other usual choice, slower
    python3 export_lpips.py alex.onnx --size 640x480

The weights are those that the package `lpips` (Zhang et al.) and torchvision load, the latter from
the network when it is used first. The arithmetic is that of lpips.LPIPS; what OpenCV 4.6 cannot
broadcast is written as convolutions. The script compares its values with lpips' own before it
writes, and with OpenCV's where cv2 is installed.
"""
import argparse
import sys


def needed(name):
    try:
        return __import__(name)
    except ImportError as problem:
        sys.exit(f"export_lpips.py needs the package '{name}': {problem}; "
                 "pip install torch torchvision lpips onnx")


torch = needed("torch")
lpips = needed("lpips")


def filter_of(weights, bias=None):
    """A 1x1 convolution with fixed weights [to, from]."""
    out = torch.nn.Conv2d(weights.shape[1], weights.shape[0], 1, bias=bias is not None)
    out.weight.data = weights[:, :, None, None].clone()
    if bias is not None:
        out.bias.data = bias.clone()
    return out


class Distance(torch.nn.Module):
    """Two images [1, 3, H, W] in [-1, 1] -> their distance [1, 1, 1, 1]."""

    def __init__(self, model):
        super().__init__()
        shift, scale = (v.detach().reshape(3) for v in (model.scaling_layer.shift, model.scaling_layer.scale))
        self.scaling = filter_of(torch.diag(1 / scale), -shift / scale)
        self.net = model.net
        # The weights of a layer are those of a 1x1 convolution to one channel, without bias.
        weights = [lin.model[-1].weight.detach().reshape(1, -1) for lin in model.lins]
        self.lins = torch.nn.ModuleList(filter_of(w) for w in weights)
        # The sum of the channels, in each channel; OpenCV 4.6 wants equal weights but once.
        sums = {n: filter_of(torch.ones(n, n)) for n in {w.shape[1] for w in weights}}
        self.sums = torch.nn.ModuleList(sums[w.shape[1]] for w in weights)

    def forward(self, image, truth):
        of_image, of_truth = (self.net(self.scaling(x)) for x in (image, truth))
        distance = 0
        for a, b, lin, channels in zip(of_image, of_truth, self.lins, self.sums):
            unit = [x / (torch.sqrt(channels(x * x)) + 1e-10) for x in (a, b)]
            d = unit[0] - unit[1]
            distance = distance + torch.nn.functional.adaptive_avg_pool2d(lin(d * d), 1)
        return distance


def by_opencv(path, a, b):
    try:
        import cv2
    except ImportError:
        return None
    net = cv2.dnn.readNetFromONNX(path)
    net.setInput(a.numpy(), "picture")
    net.setInput(b.numpy(), "truth")
    return float(net.forward().reshape(-1)[0])


def main():
    parser = argparse.ArgumentParser(description="LPIPS as an ONNX file for gflow")
    parser.add_argument("output", help="output file, .onnx")
    parser.add_argument("--net", choices=["alex", "vgg", "squeeze"], default="alex")
    parser.add_argument("--size", help="WIDTHxHEIGHT of the images; default: any size")
    arguments = parser.parse_args()
    width, height = (int(v) for v in (arguments.size or "96x64").split("x"))
    model = lpips.LPIPS(net=arguments.net).eval()
    distance = Distance(model).eval()
    a, b = (torch.rand(1, 3, height, width) * 2 - 1 for _ in range(2))
    with torch.no_grad():
        theirs, ours = float(model(a, b)), float(distance(a, b))
        if abs(theirs - ours) > 1e-4 * max(1, abs(theirs)):
            sys.exit(f"lpips computes {theirs}, the export would compute {ours}: nothing was written")
        open_sizes = None if arguments.size else {
            name: {2: "height", 3: "width"} for name in ("picture", "truth")}
        torch.onnx.export(distance, (a, b), arguments.output, input_names=["picture", "truth"],
                          output_names=["distance"], dynamic_axes=open_sizes, opset_version=11)
    opencv = by_opencv(arguments.output, a, b)
    print(f"{arguments.output}: {theirs:.6f} by lpips, {ours:.6f} here, in OpenCV "
          + ("not tested (no cv2)" if opencv is None else f"{opencv:.6f}"))


if __name__ == "__main__":
    main()
