// SPDX-License-Identifier: Apache-2.0
// From Gaussians to an image and back, as one program for each choice of channels.
#include "project.cl"
#include "splat.cl"
#include "splat_bwd.cl"
