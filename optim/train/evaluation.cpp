// SPDX-License-Identifier: Apache-2.0
#include "optim/train/evaluation.hpp"

#include <cmath>
#include <limits>
#include <map>

#include "optim/data/estimated_flow.hpp"
#include "optim/loss/metrics.hpp"
#include "optim/train/pictures.hpp"
#include "optim/train/warning.hpp"

namespace gflow {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kMoving = 1;  // [px] a pixel counts as dynamic above this
constexpr size_t kMostWithDis = 30;

// The flow a view is compared with: planes [2, H, W], where it is known, and where it moves.
struct Reference {
  std::vector<float> planes;
  std::vector<uint8_t> known, moving;
  double time = 0;              // it leads to this time [0, 1]
  const Frame* next = nullptr;  // the picture it leads to; null: the camera rests
};

std::vector<float> planes_of(const FlowField& flow) {
  const size_t pixels = flow.uv.size() / 2;
  std::vector<float> planes(flow.uv.size());
  for (size_t i = 0; i < pixels; ++i) {
    planes[i] = flow.uv[2 * i];
    planes[pixels + i] = flow.uv[2 * i + 1];
  }
  return planes;
}

Reference reference_of(const TeacherFlow& teacher, bool truth) {
  Reference r;
  r.planes = planes_of(teacher.flow);
  r.known = truth ? teacher.flow.valid : teacher.confidence;
  const size_t pixels = r.known.size();
  r.moving.resize(pixels);
  for (size_t i = 0; i < pixels; ++i)
    r.moving[i] = r.known[i] && std::hypot(r.planes[i], r.planes[pixels + i]) > kMoving;
  return r;
}

// For each frame the track's next one among `frames`, or null; no further than max_gap steps.
std::vector<const Frame*> followers(const std::vector<Frame>& frames, int max_gap) {
  std::vector<const Frame*> next(frames.size(), nullptr);
  for (size_t i = 0; i < frames.size(); ++i)
    for (const Frame& other : frames)
      if (other.track == frames[i].track && other.time > frames[i].time &&
          other.step - frames[i].step <= max_gap && (!next[i] || other.time < next[i]->time))
        next[i] = &other;
  return next;
}

double mean_of(const std::vector<ViewFigures>& views, double ViewFigures::*figure) {
  double sum = 0;
  size_t count = 0;
  for (const ViewFigures& view : views)
    if (std::isfinite(view.*figure)) {
      sum += view.*figure;
      ++count;
    }
  return count ? sum / double(count) : kNone;
}

// No pixel selected is no figure; an empty mask would mean all of them.
bool any(const std::vector<uint8_t>& mask) {
  for (const uint8_t m : mask)
    if (m) return true;
  return false;
}

}  // namespace

Evaluation evaluate(Queue& queue, Model& model, const TrainConfig& config,
                    const LoadedScene& loaded, const std::vector<Frame>& frames,
                    const ProgressCallback& progress, const std::string& folder,
                    const std::string& flow_folder) {
  FrameStore& store = *loaded.frames;
  const FlowBetween dis(loaded.scene, store, flow_folder, warn);
  Renderer renderer(queue, engine_settings(config));
  const float level = float(shown_level(config.scene.background)) / 255;
  const std::vector<const Frame*> next = followers(frames, config.flow.max_gap);
  Evaluation result;
  result.flow_reference = "none";
  result.trained_on = are_trained_on(loaded.scene, frames);
  const size_t stride = (frames.size() + kMostWithDis - 1) / kMostWithDis;  // of views with DIS
  for (size_t i = 0; i < frames.size(); ++i) {
    const Frame& frame = frames[i];
    const Camera& camera = store.camera(frame);
    const auto truth_image = store.rgb(frame);
    Reference reference;
    const bool has_truth = !frame.flow_path.empty(),
               with_dis = config.flow.enabled && i % stride == 0;
    if (has_truth) {
      reference = reference_of(read_true_flow(frame, camera.width, camera.height), true);
      reference.time = frame.flow_time;
      result.flow_reference = "true";
    } else if (next[i] && with_dis) {
      reference = reference_of(dis.teacher(frame, *next[i]), false);
      reference.time = next[i]->time;
      reference.next = next[i];
      if (result.flow_reference == "none") result.flow_reference = "dis";
    }

    Shot shot;
    shot.view.camera = pinhole(camera, config.render.near);
    shot.view.camera_t2 =
        pinhole(store.camera(reference.next ? *reference.next : frame), config.render.near);
    shot.time = frame.time;
    shot.time_t2 = reference.time;
    shot.flow = !reference.planes.empty();
    shot.background = {level, level, level};
    renderer.forward(queue, model, shot);
    const Images& images = renderer.images();
    const Picture truth = Picture::from_bytes(camera.width, camera.height, truth_image->pixels);
    const std::vector<float> planes = images.rgb.read(queue);
    const Picture picture = Picture::from_planes(camera.width, camera.height, planes);
    if (!folder.empty())
      write_png(folder + "/" + frame.name + ".png",
                picture_of_rgb(camera.width, camera.height, planes));

    ViewFigures view;
    view.name = frame.name;
    view.psnr = psnr(picture, truth);
    view.ssim = ssim(picture, truth);
    view.psnr_dynamic = view.flow_epe = view.flow_epe_dynamic = view.teacher_epe_dynamic = kNone;
    if (shot.flow && any(reference.known)) {
      const std::vector<float> flow = images.flow.read(queue);
      view.flow_epe = flow_metrics(flow, reference.planes, reference.known).epe;
      if (any(reference.moving)) {
        view.psnr_dynamic = psnr(picture, truth, reference.moving);
        view.flow_epe_dynamic = flow_metrics(flow, reference.planes, reference.moving).epe;
        if (has_truth && with_dis && next[i] && next[i]->camera == frame.camera)
          view.teacher_epe_dynamic = flow_metrics(planes_of(dis.vectors(frame, *next[i])),
                                                  reference.planes, reference.moving)
                                         .epe;
      }
    }
    result.views.push_back(view);
    if (progress) progress(i + 1, frames.size());
  }
  for (double ViewFigures::*figure :
       {&ViewFigures::psnr, &ViewFigures::ssim, &ViewFigures::psnr_dynamic, &ViewFigures::flow_epe,
        &ViewFigures::flow_epe_dynamic, &ViewFigures::teacher_epe_dynamic})
    result.mean.*figure = mean_of(result.views, figure);
  return result;
}

}  // namespace gflow
