// SPDX-License-Identifier: Apache-2.0
// What the viewer shows: a run, finished or in training, or a splat file. Everything is read when
// it is asked for, and again only when it has changed. All methods are thread-safe.
#pragma once
#include <functional>
#include <memory>
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "apps/viewer/live_model.hpp"
#include "apps/viewer/view_model.hpp"
#include "optim/eval/views.hpp"
#include "optim/formats/splat_table.hpp"
#include "optim/model/selection.hpp"
#include "optim/runs/run_state.hpp"
#include "optim/scene/loaded_scene.hpp"

namespace gflow {

// There is nothing to show yet: a run without a model.
struct NotYet : Error {
  using Error::Error;
};
// A camera or a file that does not exist.
struct NoSuchView : Error {
  using Error::Error;
};

// A device, opened on its first use, because most models need none.
class ViewDevice {
 public:
  explicit ViewDevice(std::function<std::unique_ptr<Queue>()> open) : open_(std::move(open)) {}
  // Calls use(queue), while no other thread does.
  template <class Use>
  auto with_queue(Use&& use) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!queue_) queue_ = open_();
    return use(*queue_);
  }

 private:
  std::function<std::unique_ptr<Queue>()> open_;
  std::mutex mutex_;
  std::unique_ptr<Queue> queue_;
};

class ViewSource {
 public:
  // Error if the path is neither a run nor a splat file. iteration: as for read_run_state; a fixed
  // one is shown even while training goes on. The device must outlive it.
  ViewSource(const std::string& run_or_file, int iteration, Undrawable undrawable,
             ViewDevice& device);

  // A training of this process into a run folder that may not exist yet.
  ViewSource(const std::string& run, const TrainOptions& config, std::shared_ptr<LiveModel> live,
             ViewDevice& device);

  const std::string& name() const { return name_; }
  const std::string& path() const { return path_; }  // as it was given
  bool is_run() const { return run_.has_value(); }
  // Whether a process trains the run now.
  bool is_live() const;

  // {"iteration", "iterations", "live", "model"}: the newest model. Reads no model.
  nlohmann::ordered_json state();
  // Name, times, cameras and results (apps/viewer/README.md).
  nlohmann::ordered_json info();
  // The same for a file of its own: not live, no images, but the lines of metrics().
  nlohmann::ordered_json info_of_file();

  struct Packed {
    std::string tag;  // changes when the model does
    std::shared_ptr<const std::string> bytes;
  };
  // The newest model as bytes for the page. NotYet if the run has none.
  Packed model();
  struct FileModel {
    std::string bytes;
    size_t count = 0, whole = 0;  // Gaussians in the file and in the model
    bool rounds_motion = false;   // poses or keys, compact or not, which is not part of psnr
    double psnr = 0;              // of a compact one, see psnr_between() [dB]
  };
  // What is selected of it for a file of its own. Error if that is nothing. compact: rounded.
  FileModel model_of_file(const Selection& selection, bool compact);

  // The true image of camera `index` of info(), as training saw it: a PNG. NoSuchView if there is
  // none.
  std::vector<uint8_t> image(size_t index);

  // {"from", "lines", "next"}: lines of metrics.jsonl from number `from`, at most 5000; from the
  // beginning if there are fewer, because the run was started anew.
  nlohmann::ordered_json metrics(size_t from) const;

 private:
  struct Place;
  struct View;
  std::optional<Place> newest_place() const;
  Place newest_place_or_throw() const;
  HostModel read_model_at(Place& place);  // sets the place to that of what was read
  bool is_in_training() const { return live_ && live_->is_training(); }
  void load_scene_once();
  std::vector<View> views();
  ViewFacts facts(const HostModel& model);
  std::string bytes_of(const HostModel& model, ViewPrecision precision);
  std::vector<double> pose_times() const;
  std::vector<RenderView> some_views(const HostModel& model);

  std::string path_, name_;
  int iteration_;
  Undrawable undrawable_;
  ViewDevice& device_;
  std::optional<RunFolder> run_;
  TrainOptions config_;
  std::shared_ptr<LiveModel> live_;  // a training of this process, or null

  std::mutex model_mutex_;
  std::string tag_;                            // of packed_
  std::shared_ptr<const std::string> packed_;  // the last model
  std::optional<std::array<double, 3>> origin_;

  std::mutex scene_mutex_;
  bool scene_was_tried_ = false;
  std::optional<LoadedScene> loaded_;
  std::vector<std::string> notices_;
};

}  // namespace gflow
