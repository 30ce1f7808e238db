// SPDX-License-Identifier: Apache-2.0
// Work per work-item, for host and kernels. Every program is built with LANES, the pixels or floats
// of one vector (1 on GPUs), and GROUP, the work-items that share a chunk (1 on CPUs).
#ifndef GFLOW_WORK_H
#define GFLOW_WORK_H

#if defined(__OPENCL_VERSION__) && !defined(GROUP)
#define GROUP 1  // only for the syntax check; the host always defines it
#endif
#define SORT_BITS(group) ((group) == 1 ? 11 : 8)  // per digit (sort.cl)
#define ADAM_SPAN 16  // rows per work-item on CPUs (adam.cl); a multiple of every LANES
// Rows of pixels per work-item (image_loss.cl). Long strips recompute less of their neighbours'
// rows; a GPU keeps short ones in registers.
#define LOSS_STRIP(lanes) ((lanes) == 1 ? 8 : 64)

#endif
