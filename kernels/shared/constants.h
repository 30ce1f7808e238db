// SPDX-License-Identifier: Apache-2.0
// Constants that define the image, shared by kernels, host and reference.
#ifndef GFLOW_CONSTANTS_H
#define GFLOW_CONSTANTS_H

#define TILE 16           // a tile is TILE x TILE pixels
#define CELL 4            // a tile has 16 cells of CELL x CELL pixels, one mask bit each
#ifndef ALPHA_MIN_LOG2    // `gflow bench pareto` varies this and T_MIN
#define ALPHA_MIN_LOG2 -7.99435344f  // log2(1/255): fainter splats do not contribute to a pixel
#endif
#define ALPHA_MAX 0.99f   // alpha is clamped here; no gradient through the clamp
#ifndef T_MIN
#define T_MIN 1e-4f       // a pixel is saturated when its transmittance is below this
#endif
#define DILATION 0.3f     // added to both variances of a projected splat [px^2]
#define FOV_MARGIN 0.3f   // J is clamped at this share of the half width outside the image
#define HALF_LOG2_E 0.721347520f       // exp(-q/2) = exp2(-HALF_LOG2_E q)
#define SQRT_HALF_LOG2_E 0.849321800f  // folded into K: alpha = exp2(log2 o - |z|^2)
#define LN_2 0.693147181f
#define SPLAT_FLOATS 16   // of one packed splat: 64 bytes, one cache line
#define ALL_ROWS 0xffffffffu  // a number of rows that means all rows of an array
#define MOMENTS 16        // sums per splat in the backward pass

#endif
