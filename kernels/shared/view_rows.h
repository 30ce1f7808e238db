// SPDX-License-Identifier: Apache-2.0
// The rows of a model that a view may show, ascending (OpenCL C only; optim/motion/view_rows.hpp).
// Arrays made for the view have one entry per listed row: entry k belongs to row view_row(k, rows).
#ifndef GFLOW_VIEW_ROWS_H
#define GFLOW_VIEW_ROWS_H

// rows: [entries], or null if the view lists all rows.
static inline uint view_row(uint k, global const uint* rows) { return rows ? rows[k] : k; }

#endif
