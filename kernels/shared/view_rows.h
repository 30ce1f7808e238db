// SPDX-License-Identifier: Apache-2.0
// The rows of a model that a view may show, ascending (OpenCL C only; optim/motion/view_rows.hpp).
// All that is made for the view has an entry for each: entry k is of row view_row(k, rows).
#ifndef GFLOW_VIEW_ROWS_H
#define GFLOW_VIEW_ROWS_H

// rows: [entries], or null where the view takes all rows.
static inline uint view_row(uint k, global const uint* rows) { return rows ? rows[k] : k; }

#endif
