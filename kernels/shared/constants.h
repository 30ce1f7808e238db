// SPDX-License-Identifier: Apache-2.0
// The numbers that define the image, once for kernels, host and reference.
#ifndef GFLOW_CONSTANTS_H
#define GFLOW_CONSTANTS_H

#define TILE 16           // a tile is TILE x TILE pixels
#define CELL 4            // and holds 16 cells of CELL x CELL pixels, one bit each in a mask
#ifndef ALPHA_MIN_LOG2    // `gflow bench pareto` tries others, of T_MIN too
#define ALPHA_MIN_LOG2 -7.99435344f  // log2(1/255): a fainter splat does not touch the pixel
#endif
#define ALPHA_MAX 0.99f   // opacity is cut here; no gradient through the cut (numerics 2)
#ifndef T_MIN
#define T_MIN 1e-4f       // a pixel is finished when less than this passes through
#endif
#define DILATION 0.3f     // added to both variances of a projected splat [px^2]
#define FOV_MARGIN 0.3f   // J is taken at most this share of the half width outside the image
#define HALF_LOG2_E 0.721347520f       // exp(-q/2) = exp2(-HALF_LOG2_E q)
#define SQRT_HALF_LOG2_E 0.849321800f  // folded into the whitening K
#define LN_2 0.693147181f
#define SPLAT_FLOATS 16   // one packed splat: 64 bytes, one cache line
#define ALL_ROWS 0xffffffffu  // of an array, however many
#define MOMENTS 16        // sums a splat collects in the backward pass

#endif
