// SPDX-License-Identifier: Apache-2.0
// Compares the rendered depth of a view with its depth file (loss.depth).
#pragma once
#include <map>

#include "optim/images/lru_cache.hpp"
#include "optim/loss/depth_loss.hpp"
#include "optim/objectives/objective.hpp"
#include "optim/options/train_options.hpp"
#include "optim/scene/frame_store.hpp"

namespace gflow {

// Looks into the depth files if loss.depth needs them. Error if there are none or one cannot be
// read; warns of files that say nothing, and if they are in another unit than the scene's points.
void require_depth(const TrainOptions& options, const Scene& scene, const FrameStore& frames);

class DepthObjective : public Objective {
 public:
  // All references must outlive it. require_depth has been called.
  DepthObjective(Queue& queue, const TrainOptions& options, const Scene& scene, FrameStore& frames);

  static DepthFit fit_of(DepthFiles files);

  void request(Queue& queue, const ViewContext& view, Shot& shot) override;
  void add_gradients(Queue& queue, const ViewContext& view, const Renderer& renderer,
                     ImageGradients& v) override;
  // The fit of the view's image, and whether it is of the whole image.
  std::vector<float> take_view(Queue& queue, const ViewContext& view) override;
  void give_view(Queue& queue, const ViewContext& view, const std::vector<float>& fit) override;
  // depth_loss and depth_error (DepthLossValue::error) of the last view that has depth; 0 before.
  void report(Queue& queue, const Renderer& renderer, LossReport& report) override;
  void save_state(Queue& queue, Arrays& arrays) override;
  void load_state(Queue& queue, const Arrays& arrays, const std::string& path) override;

 private:
  using DepthMap = std::vector<float>;
  // The file of a frame as DepthLoss needs it: NaN where it has no depth, and for a fit with
  // median 0 and median deviation 1.
  DepthMap load(const Frame& frame) const;
  DepthLossValue value(Queue& queue);
  void warn_of_no_fit(const DepthLossValue& last);

  const TrainOptions& options_;
  const Scene& scene_;
  FrameStore& frames_;
  LruCache<std::string, DepthMap> cache_;       // by Frame::depth_path
  const std::map<std::string, size_t> images_;  // their numbers in the fits, likewise
  DepthLoss loss_;
  // Whether an image was fitted as a whole; before, the fit of a part must do.
  std::vector<uint8_t> whole_fits_;
  DepthMap part_;  // source of asynchronous writes
  Buffer<float> file_{"depth file"};
  bool has_depth_ = false;  // whether the view has depth
  bool is_new_ = false;     // value_ must be read again
  DepthLossValue value_;
  int unfitted_ = 0;  // reports one after the other of views without a fit
};

}  // namespace gflow
