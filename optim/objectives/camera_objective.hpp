// SPDX-License-Identifier: Apache-2.0
// Corrects the cameras while training (cameras.refine): Adam on their poses and on a common factor
// of their focal lengths, by the gradients of all losses on images, depth and flow, at both times.
// A weak pull leads back to where they began, so that cameras and scene do not drift together. The
// corrected cameras are those of the FrameStore.
#pragma once
#include <vector>

#include "optim/engine/camera_gradient.hpp"
#include "optim/flow/flow_store.hpp"
#include "optim/objectives/objective.hpp"
#include "optim/options/train_options.hpp"
#include "optim/scene/frame_store.hpp"

namespace gflow {

// Whether cameras.refine applies to a scene.
bool refines_cameras(const CameraOptions& options, const Scene& scene);

class CameraObjective : public Objective {
 public:
  // The references must outlive it.
  CameraObjective(Queue& queue, const TrainOptions& options, const Scene& scene, FrameStore& frames,
                  const std::vector<FlowPair>& pairs);

  // Must be the first objective that adds gradients of poses: what others add is not of the camera.
  void add_pose_gradients(Queue& queue, const ViewContext& view, const Renderer& renderer,
                          GaussianGradients& gradients) override;
  void end_step(Queue& queue, const StepContext& context) override;
  // camera_turn, camera_shift: root mean square of the corrections of training cameras [degrees],
  // [% of the depth of the scene].
  void report(Queue& queue, const Renderer& renderer, LossReport& report) override;
  void save_state(Queue& queue, Arrays& arrays) override;
  void load_state(Queue& queue, const Arrays& arrays, const std::string& path) override;

 private:
  static constexpr size_t kPose = 6;  // CameraCorrection: turn x y z, shift x y z

  // Adam's state of one number each, of a row of numbers with one count of steps.
  struct Rows {
    Rows(size_t rows, size_t size)
        : size(size), values(rows * size), mean(rows * size), square(rows * size), steps(rows) {}
    void step(size_t row, const std::vector<double>& gradient, double rate);
    size_t size;
    std::vector<float> values, mean, square;
    std::vector<uint32_t> steps;
  };
  Eigen::Matrix4d corrected(size_t camera) const;
  // Sets the store's cameras: training cameras as corrected, others moved along with them.
  void apply();
  void save(const char* name, const Rows& rows, Arrays& arrays) const;
  void load(const char* name, Rows& rows, const Arrays& arrays, const std::string& path);

  const TrainOptions& options_;
  const Scene& scene_;
  FrameStore& frames_;
  const std::vector<FlowPair>& pairs_;
  CameraGradients gradients_;
  std::vector<Eigen::Matrix4d> start_;  // poses of all cameras before the first step
  std::vector<double> depths_;          // of each camera's scene; 0: not a training camera
  double start_focal_;                  // multiple of the scene's focal lengths
  std::vector<size_t> seen_;            // cameras of the sums that were started in this step
  Rows poses_;                          // one row per camera
  Rows focal_;                          // one row: log of the common factor
};

}  // namespace gflow
