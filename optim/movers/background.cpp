// SPDX-License-Identifier: Apache-2.0
#include "optim/movers/background.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "optim/model/renderer.hpp"

namespace gflow {
namespace {

constexpr int kSide = 800;               // of the longer side of the images trained on [px]
constexpr float kLeastDiffers = 20;      // of 255: pixels of what rests differ less
constexpr float kTimesUsual = 5;         // nor by more than this multiple of the median difference
constexpr double kLeastSuspects = 0.25;  // share of a moving part's pixels
constexpr size_t kLeastPixels = 30;      // of a moving part

// The scene at one time, of reduced images in memory, without the suspects.
Scene scene_at_rest(const Scene& scene, FrameStore& store, const SmallVideo& video,
                    const Suspects& suspects) {
  Scene still = scene;
  still.test.clear(), still.val.clear(), still.train.clear();
  still.cameras.clear();
  still.steps = 1;
  still.masks = Masks::ignore;
  if (still.points.size() == 0) still.points = suspects.points;
  for (size_t i = 0; i < video.size(); ++i) {
    Frame frame = *video.frames[i];
    const Camera camera = limited(store.camera(frame), kSide);
    frame.image =
        std::make_shared<const Image>(resized(*store.rgb(frame), camera.width, camera.height));
    Image mask{video.width(), video.height(), 1, {}};
    for (const uint8_t suspect : suspects.masks[i].pixels) mask.pixels.push_back(suspect ? 0 : 255);
    if (const auto counted = store.counted(frame)) {
      const Image small = resized(*counted, mask.width, mask.height);
      for (size_t k = 0; k < mask.pixels.size(); ++k)
        if (small.pixels[k] < 255) mask.pixels[k] = 0;
    }
    frame.mask = std::make_shared<const Image>(std::move(mask));
    frame.mask_path = "mask of " + frame.name;
    frame.video_frame = -1;
    frame.depth_path.clear();
    frame.step = 0, frame.time = 0;
    frame.camera = int(i);
    still.cameras.push_back(camera);
    still.train.push_back(std::move(frame));
  }
  return still;
}

TrainOptions options_at_rest(const TrainOptions& options) {
  TrainOptions still = options;
  still.scene.resolution = 1;
  still.train.iterations = options.init.background;
  still.train.sequential = false;
  still.train.minutes = 0;
  still.train.focus = 0;
  still.motion.model = choice_of(MotionModelKind::spacetime);
  still.flow.enabled = false;
  still.guidance.provider = GuidanceProvider::none;
  still.init.from = InitFrom::automatic;
  still.init.file.clear();
  still.loss.depth = 0;
  return still;
}

// The largest difference of a colour channel between a rendered image and the frame, both averaged
// over 3 x 3 pixels, at every pixel [0, 255].
std::vector<float> differences(const std::vector<float>& rgb, const Image& image) {
  const int w = image.width, h = image.height;
  std::vector<float> result(size_t(w) * size_t(h));
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x) {
      float most = 0;
      for (size_t c = 0; c < 3; ++c) {
        float sum = 0;
        int count = 0;
        for (int j = std::max(y - 1, 0); j <= std::min(y + 1, h - 1); ++j)
          for (int i = std::max(x - 1, 0); i <= std::min(x + 1, w - 1); ++i, ++count) {
            const size_t at = size_t(j) * size_t(w) + size_t(i);
            sum += 255 * rgb[c * result.size() + at] - float(image.pixels[3 * at + c]);
          }
        most = std::max(most, std::fabs(sum) / float(count));
      }
      result[size_t(y) * size_t(w) + size_t(x)] = most;
    }
  return result;
}

// The connected parts of pixels that differ in which there are suspects.
Mask moving_pixels(const std::vector<float>& differs, const Mask& suspects) {
  std::vector<float> sorted = differs;
  const auto middle = sorted.begin() + long(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  const float least = std::max(kLeastDiffers, kTimesUsual * *middle);
  Mask mask(suspects.width, suspects.height);
  for (size_t i = 0; i < differs.size(); ++i) mask.pixels[i] = differs[i] > least;
  mask = with_share_around(mask, 3, 0.5);
  const Parts parts = parts_of(mask);
  std::vector<size_t> suspected(size_t(parts.count) + 1);
  for (size_t i = 0; i < differs.size(); ++i)
    suspected[size_t(parts.labels[i])] += suspects.pixels[i];
  for (size_t i = 0; i < differs.size(); ++i) {
    const size_t part = size_t(parts.labels[i]);
    if (part == 0) continue;
    const size_t size = parts.sizes[part - 1];
    mask.pixels[i] =
        size >= kLeastPixels && double(suspected[part]) >= kLeastSuspects * double(size);
  }
  return mask;
}

}  // namespace

StillBackground background_of(Queue& queue, const Scene& scene, FrameStore& store,
                              const SmallVideo& video, const Suspects& suspects,
                              const TrainOptions& options, const TrainModel& train,
                              const ProgressCallback& progress) {
  StillBackground background;
  const TrainOptions still = options_at_rest(options);
  background.model = train(scene_at_rest(scene, store, video, suspects), still, progress);
  Model model(queue, background.model, Purpose::rendering);
  Renderer renderer(queue, engine_settings(still));
  const float near = near_or_default(options.render.near, scene);
  for (size_t i = 0; i < video.size(); ++i) {
    Shot shot;
    shot.view.camera = shot.view.camera_t2 = pinhole(video.cameras[i], near);
    shot.depth = true;
    renderer.forward(queue, model, shot);
    background.moving.push_back(moving_pixels(
        differences(renderer.images().rgb.read(queue), video.images[i]), suspects.masks[i]));
    std::vector<float> depth = renderer.images().depth.read(queue);
    const std::vector<float> alpha = renderer.images().alpha.read(queue);
    for (size_t k = 0; k < depth.size(); ++k)
      depth[k] = alpha[k] > 0.5f ? depth[k] / alpha[k] : std::numeric_limits<float>::infinity();
    background.depths.push_back(std::move(depth));
  }
  return background;
}

}  // namespace gflow
