// SPDX-License-Identifier: Apache-2.0
// From Gaussians to an image and back, compiled once per choice of channels.
#include "project.cl"
#include "splat.cl"
#include "splat_bwd.cl"
