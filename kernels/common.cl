// SPDX-License-Identifier: Apache-2.0
// What every run needs, as one program: a compiler takes 0.12 s before it reads the first line of
// one (PoCL 3.1; 0.03 s when it finds the program in its cache), and 0.5 s for the first.
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
