// SPDX-License-Identifier: Apache-2.0
// The kernels that every run needs, as one program: compilers take a fixed time per program, so one
// program starts faster than fifteen.
#include "checks/selfcheck.cl"
#include "density/adc.cl"
#include "density/rows.cl"
#include "engine/bin.cl"
#include "engine/cell_mask.cl"
#include "engine/tile_sort.cl"
#include "loss/flow_loss.cl"
#include "loss/flow_tiles.cl"
#include "loss/image_loss.cl"
#include "motion/sh.cl"
#include "motion/view_rows.cl"
#include "primitives/adam.cl"
#include "primitives/reduce.cl"
#include "primitives/scan.cl"
#include "primitives/sort.cl"
