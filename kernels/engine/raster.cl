// SPDX-License-Identifier: Apache-2.0
// From Gaussians to an image and back, compiled once per choice of channels.
#include "engine/project.cl"
#include "engine/splat.cl"
