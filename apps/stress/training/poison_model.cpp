// SPDX-License-Identifier: Apache-2.0
// T29, of what is trained: one broken value in one Gaussian at the left of an image, in every
// parameter of every motion model and of its colour. At the right no bit may change, of no other
// Gaussian may a gradient change or cease to be a number, nor of what all of them share.
#include <cstring>

#include "apps/stress/figures.hpp"
#include "apps/stress/stress.hpp"
#include "optim/train/renderer.hpp"
#include "tests/scenes.hpp"
#include "tests/train/small_training.hpp"

namespace gflow::stress {
namespace {

constexpr int kWidth = 96, kHeight = 32;
constexpr size_t kModelPixels = size_t(kWidth) * kHeight;

// The culprit (0), one under it (1), and six at the right.
HostModel two_sides(MotionModelKind kind) {
  HostModel host;
  host.shape.motion = kind;
  host.shape.sh_degree = 1;
  host.shape.duration = 1;
  host.shape.keys = 3;
  host.shape.bases = 2;
  host.shape.hexplane.resolution = host.shape.hexplane.times = 3;  // small: all of it is compared
  host.shape.hexplane.levels = 1;
  host.shape.hexplane.half_size = {3, 3, 6};
  append_gaussian(host, {-1.6f, .1f, 4}, .1f, some_color(0), 0);
  append_gaussian(host, {-1.6f, 0, 5}, .15f, some_color(1), 0);
  for (uint i = 0; i < 6; ++i)
    append_gaussian(host, {1.3f + .06f * float(i), .1f * float(i) - .2f, 4 + .1f * float(i)}, .1f,
                    some_color(2 + i), 0);
  for (const char* name : {"velocities", "half_accelerations", "turns"}) host.groups.erase(name);
  for (uint k = 0; k < 9 * host.count; ++k) host.groups["sh_rest"].push_back(.1f * noise(60, k));
  add_rest(host.shape, host.groups, host.count);
  for (const MotionColumns& columns : motion_columns(host.shape))
    for (size_t k = 0; k < host.groups[columns.group].size(); ++k)
      host.groups[columns.group][k] += .02f * noise(61, uint(k));
  return host;
}

// One that is drawn with its flow, and its gradients.
class Drawn {
 public:
  Drawn(Queue& queue, MotionModelKind kind)
      : queue_(queue), host_(two_sides(kind)), model_(queue, host_), renderer_(queue, {}) {
    shot_.view.camera = shot_.view.camera_t2 = test_camera(kWidth, kHeight);
    shot_.time = .4;
    shot_.time_t2 = .6;
    shot_.flow = shot_.depth = true;
    const auto random = [&](Buffer<float>& v, size_t planes, uint stream) {
      std::vector<float> values;
      for (uint k = 0; k < planes * kModelPixels; ++k) values.push_back(noise(stream, k));
      v = Buffer<float>(queue, values, "v");
    };
    random(v_.v_rgb, 3, 62);
    random(v_.v_alpha, 1, 63);
    random(v_.v_depth, 1, 64);
    random(v_.v_flow, 2, 65);
  }

  struct Outcome {
    std::vector<std::vector<float>> images;
    std::vector<std::vector<float>> gradients;  // of the model's tables, group by group
  };
  Outcome draw() {
    model_.parameters.forget_seen(queue_);
    for (Table* table : model_.parameters.tables())
      for (ParameterGroup& group : table->groups) group.grads.fill(queue_, 0.f);
    renderer_.forward(queue_, model_, shot_);
    renderer_.backward(queue_, model_, v_);
    const Images& images = renderer_.images();
    Outcome outcome;
    for (const Buffer<float>* image : {&images.rgb, &images.alpha, &images.depth, &images.flow})
      outcome.images.push_back(image->read(queue_));
    for (const Table* table : model_.parameters.tables())
      for (const ParameterGroup& group : table->groups)
        outcome.gradients.push_back(group.grads.read(queue_));
    return outcome;
  }

  // Whether the culprit truly covers tiles at the right, e.g. with a size of 1e6.
  bool reaches_right() {
    const std::vector<cl_uint> rows = renderer_.rows().read(queue_);
    if (rows.empty() || rows[0] != 0) return false;
    const Splats& splats = renderer_.engine().splats();
    return splats.tiles_touched.read_range(queue_, 0, 1)[0] > 0 &&
           splats.tile_boxes.read_range(queue_, 0, 4)[2] >= 4;
  }

  size_t count() const { return host_.count; }
  Model& model() { return model_; }

 private:
  Queue& queue_;
  HostModel host_;
  Model model_;
  Renderer renderer_;
  Shot shot_;
  ImageGradients v_;
};

// Whether a table, by its place in Parameters::tables(), is of all Gaussians together.
bool is_shared(const Parameters& p, size_t table) {
  return table > 0 && p.more_specs[table - 1].keys == 0;
}

bool same_bits(float a, float b) { return std::memcmp(&a, &b, sizeof(float)) == 0; }

struct ModelHarm {
  double pixels = 0, gradients = 0, not_finite = 0, cases = 0;
  double reached = 0;  // cases where the culprit truly lies at the right: nothing is compared

  void add(const Drawn::Outcome& found, const Drawn::Outcome& clean, const Parameters& p,
           bool reaches) {
    ++cases;
    reached += reaches;
    for (size_t k = 0; k < found.images.size(); ++k) {
      not_finite += count_not_finite(found.images[k]);
      for (size_t i = 0; i < found.images[k].size() && !reaches; ++i)
        pixels += i % kWidth >= 64 && !same_bits(found.images[k][i], clean.images[k][i]);
    }
    size_t g = 0;
    for (size_t t = 0; t < p.tables().size(); ++t)
      for (const ParameterGroup& group : p.tables()[t]->groups) {
        const bool shared = is_shared(p, t);
        const std::vector<float>&now = found.gradients[g], &before = clean.gradients[g];
        for (size_t i = 0; i < now.size(); ++i) {
          const size_t gaussian = i / group.width % p.count;
          if (!shared && gaussian == 0) continue;
          not_finite += !std::isfinite(now[i]);
          gradients += !shared && gaussian >= 2 && !reaches && !same_bits(now[i], before[i]);
        }
        ++g;
      }
  }
};

// Poisons in every component of the culprit's rows, in all that has rows of each Gaussian.
Rows poisoned(Queue& queue, MotionModelKind kind) {
  Drawn scene(queue, kind);
  const Drawn::Outcome clean = scene.draw();
  Parameters& p = scene.model().parameters;
  ModelHarm harm;
  double drawn = 0;
  for (const std::vector<float>& g : clean.gradients) drawn += g[0] != 0;
  for (size_t t = 0; t < p.tables().size(); ++t) {
    Table* const table = p.tables()[t];
    if (is_shared(p, t)) continue;
    for (ParameterGroup& group : table->groups) {
      const std::vector<float> before = group.values.read(queue);
      for (size_t row = 0; row < table->count; row += p.count)
        for (size_t component = 0; component < group.width; ++component)
          for (const float poison : poisons()) {
            std::vector<float> values = before;
            values[row * group.width + component] = poison;
            group.values.write(queue, values);
            const Drawn::Outcome found = scene.draw();
            harm.add(found, clean, p, std::isfinite(poison) && scene.reaches_right());
          }
      group.values.write(queue, before);
    }
  }
  const std::string of =
      fmt::format("{}, {:.0f} cases: ", names_of(kind)[size_t(kind)], harm.cases);
  return {{of + "others' pixels changed", harm.pixels, 0},
          {of + "others' gradients changed", harm.gradients, 0},
          {of + "not finite but the culprit's own gradients", harm.not_finite, 0},
          {of + "share in which it truly reaches the others", harm.reached / harm.cases, .12},
          {of + "culprit not seen before", double(drawn == 0), 0}};
}

Rows every_model(Queue& queue) {  // T29
  Rows rows;
  for (size_t kind = 0; kind < names_of(MotionModelKind{}).size(); ++kind)
    for (Row& row : poisoned(queue, MotionModelKind(kind))) rows.push_back(std::move(row));
  return rows;
}

}  // namespace

Tests poison_model_tests() { return {{"T29", "poison in the model", true, every_model}}; }

}  // namespace gflow::stress
