// SPDX-License-Identifier: Apache-2.0
// Suspects alone also contain edges, where flow is wrong, and colours alone also shadows and what
// the points show wrongly: most pixels of both move.
#include "optim/cameras/quick_motion_masks.hpp"

#include <cmath>
#include <limits>
#include <optional>

#include "runtime/base/parallel.hpp"

namespace gflow {
namespace {

constexpr size_t kMostPoints = 1000000;
constexpr float kLeastDiffers = 16;        // [grey levels]
constexpr float kSameSurface = 1.05f;      // of depths, relative to the nearest one
constexpr double kLeastPart = 1.0 / 1000;  // of the image; smaller moving parts are noise

// At each pixel, the mean colour of the nearest points that project there.
struct PointImage {
  std::vector<float> rgb;  // [height, width, 3], sums until divided by `count`
  std::vector<int> count;  // [height, width]; 0: no point
};

PointImage image_of_points(const PointCloud& points, const Camera& camera) {
  const size_t pixels = size_t(camera.width) * size_t(camera.height);
  struct Place {
    int pixel = -1;
    float depth = 0;
  };
  std::vector<Place> places(points.size());
  std::vector<float> nearest(pixels, std::numeric_limits<float>::infinity());
  for (size_t i = 0; i < points.size(); ++i) {
    const Eigen::Map<const Eigen::Vector3d> point(&points.xyz[3 * i]);
    const std::optional<double> z = camera.depth_in_view(point);
    if (!z) continue;
    const Eigen::Vector2d at = camera.project(point);
    places[i] = {int(at.y()) * camera.width + int(at.x()), float(*z)};
    float& depth = nearest[size_t(places[i].pixel)];
    depth = std::min(depth, places[i].depth);
  }
  PointImage result{std::vector<float>(3 * pixels), std::vector<int>(pixels)};
  for (size_t i = 0; i < points.size(); ++i) {
    if (places[i].pixel < 0) continue;
    const auto at = size_t(places[i].pixel);
    if (places[i].depth > kSameSurface * nearest[at]) continue;
    for (size_t c = 0; c < 3; ++c) result.rgb[3 * at + c] += float(points.rgb[3 * i + c]);
    ++result.count[at];
  }
  for (size_t at = 0; at < pixels; ++at)
    for (size_t c = 0; c < 3 && result.count[at] > 0; ++c)
      result.rgb[3 * at + c] /= float(result.count[at]);
  return result;
}

enum class Likeness { unknown, same, different };

// How a pixel compares with the points next to it, whose places are exact to about a pixel.
Likeness compared(const Image& image, const PointImage& points, int x, int y) {
  const uint8_t* rgb = &image.pixels[3 * (size_t(y) * size_t(image.width) + size_t(x))];
  Likeness result = Likeness::unknown;
  for (int j = std::max(y - 1, 0); j <= std::min(y + 1, image.height - 1); ++j)
    for (int i = std::max(x - 1, 0); i <= std::min(x + 1, image.width - 1); ++i) {
      const size_t at = size_t(j) * size_t(image.width) + size_t(i);
      if (points.count[at] == 0) continue;
      float most = 0;
      for (size_t c = 0; c < 3; ++c)
        most = std::max(most, std::fabs(points.rgb[3 * at + c] - float(rgb[c])));
      if (most <= kLeastDiffers) return Likeness::same;
      result = Likeness::different;
    }
  return result;
}

Mask without_small_parts(Mask mask) {
  const Parts parts = parts_of(mask);
  const double least = kLeastPart * double(mask.pixels.size());
  for (size_t i = 0; i < mask.pixels.size(); ++i)
    if (mask.pixels[i] && double(parts.sizes[size_t(parts.labels[i] - 1)]) < least)
      mask.pixels[i] = 0;
  return mask;
}

Mask moving_in(const Image& image, const PointImage& points, const Mask& suspects) {
  const Mask candidates = with_margin(suspects);
  Mask mask(image.width, image.height);
  for (int y = 0; y < mask.height; ++y)
    for (int x = 0; x < mask.width; ++x) {
      if (!candidates.at(x, y)) continue;
      const Likeness likeness = compared(image, points, x, y);
      mask.at(x, y) =
          likeness == Likeness::different || (likeness == Likeness::unknown && suspects.at(x, y));
    }
  return without_small_parts(with_share_around(mask, 2, 0.5));
}

}  // namespace

std::vector<Mask> quick_motion_masks(const SmallVideo& video, const ProgressCallback& progress) {
  SuspectOptions options;
  options.most_points = kMostPoints;
  // Flow over few frames also knows what is near or moves fast, and thus where nothing moves.
  options.spans = {1, 2, 4};
  options.least_parallax = 0.01;
  options.with_margin = false;
  const Suspects suspects = suspects_of(video, options, progress);
  std::vector<Mask> masks(video.size());
  for_each_parallel(video.size(), num_cores(), [&](size_t k) {
    masks[k] = moving_in(video.images[k], image_of_points(suspects.points, video.cameras[k]),
                         suspects.masks[k]);
  });
  return masks;
}

}  // namespace gflow
