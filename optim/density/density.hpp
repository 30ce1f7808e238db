// SPDX-License-Identifier: Apache-2.0
// Density control, clone / split / prune: Gaussians the loss pulls at hard become two, faint, huge
// or never visible ones go, the number stays below a cap by taking the hardest pulls first.
// Kernels: kernels/density.cl.
#pragma once
#include "optim/engine/gaussians.hpp"
#include "optim/io/npz.hpp"
#include "optim/motion/motion.hpp"
#include "runtime/sort.hpp"

namespace gflow {

struct DensityRule {
  float grad_threshold = 2e-4f;  // mean pull above which a Gaussian grows [1 / half the image]
  float min_opacity = 0.005f;    // fainter ones go
  float max_scale = 0;           // larger ones go [scene units]
  float cutoff = 0.05f;          // what is below this temporal weight all the time goes
  SplitRule split;               // how what grows becomes two
  size_t cap = 30000;            // most Gaussians
};

class Density {
 public:
  explicit Density(Queue& queue);

  // Adds one view's evidence.
  void accumulate(Queue& queue, int width, int height, const Buffer<cl_uint>& tiles_touched,
                  const Buffer<float>& v_means2d, size_t count);
  // Rebuilds all arrays of `parameters` by the evidence since the last call and forgets it.
  // Children start with zero moments and step counts. Waits once. Seed: of the children's places.
  void refine(Queue& queue, Parameters& parameters, Motion& motion, const DensityRule& rule,
              uint32_t seed);

  // The evidence so far, for a checkpoint: density/pull and density/views [N].
  void save_state(Queue& queue, Arrays& arrays) const;
  // The reverse. Error when the arrays are missing or do not fit; `path`: the file, for messages.
  void load_state(Queue& queue, const Arrays& arrays, const std::string& path);

 private:
  void forget(Queue& queue, size_t count);
  // Rows of a table with `keys` rows a Gaussian, to those of the new Gaussians.
  void gather(Queue& queue, size_t keys, const Table& from, Table& to);

  Program program_;
  Kernel<cl_uint, cl_float, cl_float, In<cl_uint>, In<float>, Out<float>, Out<cl_uint>>
      density_accumulate_;
  Kernel<cl_uint, cl_float, cl_float, cl_float, cl_float, cl_float, In<float>, In<float>, In<float>,
         In<float>, In<cl_uint>, Out<cl_uint>, Out<cl_uint>, Out<cl_uint>>
      density_rank_;
  Kernel<cl_uint, cl_uint, In<cl_uint>, In<cl_uint>, Out<cl_uint>> density_grow_;
  Kernel<cl_uint, In<cl_uint>, In<cl_uint>, Out<cl_uint>, Out<cl_uint>> density_sources_;
  Kernel<cl_uint, cl_uint, cl_uint, cl_uint, cl_int, In<cl_uint>, In<cl_uint>, In<float>,
         Out<float>>
      rows_gather_;
  Kernel<cl_uint, cl_uint, cl_uint, In<cl_uint>, In<cl_uint>, In<cl_uint>, Out<cl_uint>>
      rows_gather_counts_;
  Scan scan_;
  RadixSort sort_;
  size_t count_ = 0;  // rows the evidence is about
  Buffer<float> pull_{"pull"};
  Buffer<cl_uint> views_{"views"}, copies_{"copies"}, keys_{"density keys"},
      order_{"density order"};
  Buffer<cl_uint> offsets_{"offsets"}, source_{"source"}, child_{"child"};
};

}  // namespace gflow
