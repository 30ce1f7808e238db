// SPDX-License-Identifier: Apache-2.0
// The kernels that every run needs, as one program: compilers take a fixed time per program, so one
// program starts faster than fifteen.
#include "adam.cl"
#include "adc.cl"
#include "bin.cl"
#include "cell_mask.cl"
#include "flow_loss.cl"
#include "flow_tiles.cl"
#include "image_loss.cl"
#include "reduce.cl"
#include "rows.cl"
#include "scan.cl"
#include "selfcheck.cl"
#include "sh.cl"
#include "sort.cl"
#include "tile_sort.cl"
#include "view_rows.cl"
