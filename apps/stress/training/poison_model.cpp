// SPDX-License-Identifier: Apache-2.0
// T29 for trained parameters: one broken value in one Gaussian at the left of an image, in every
// parameter of every motion model and of colour. At the right no bit may change. Gradients of other
// Gaussians must not change and must be finite; gradients of shared parameters must be finite. If
// the value is not finite, the culprit must be drawn as if absent, or without the flow that depends
// on the value. A broken value in shared parameters affects everything; the images must be finite.
#include "apps/stress/errors.hpp"
#include "apps/stress/image/poisoned.hpp"
#include "apps/stress/stress.hpp"
#include "apps/stress/training/small_training.hpp"
#include "optim/model/renderer.hpp"
#include "optim/reference/scenes.hpp"

namespace gflow::stress {
namespace {

constexpr size_t kModelPixels = size_t(kPoisonedWidth) * kPoisonedHeight;

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
  set_static(host.shape, host.groups, host.count);
  const auto disturb = [&](const std::string& group, float by) {
    std::vector<float>& values = host.groups[group];
    for (size_t k = 0; k < values.size(); ++k) values[k] += by * noise(61, uint(k));
  };
  disturb("log_scales", .3f);  // a sphere would not show a rotation
  disturb("quats", .1f);
  for (const MotionColumns& columns : motion_columns(host.shape)) disturb(columns.group, .02f);
  for (const TableSpec& table : motion_tables(host.shape))
    for (const GroupSpec& group : table.groups) disturb(group.name, .02f);
  return host;
}

// A model rendered with flow, and its gradients.
class Drawn {
 public:
  Drawn(Queue& queue, MotionModelKind kind)
      : queue_(queue), host_(two_sides(kind)), model_(queue, host_), renderer_(queue, {}) {
    shot_.view.camera = shot_.view.camera_t2 = test_camera(kPoisonedWidth, kPoisonedHeight);
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
    std::vector<std::vector<float>> gradients;  // by table and group
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

  bool reaches() { return is_listed() && reaches_right(queue_, renderer_.engine()); }

  // Whether the culprit's axes are the world's: its factor R S is S.
  bool unturned() {
    if (!is_listed()) return false;
    const std::vector<float> f = renderer_.gaussians().factors.read_range(queue_, 0, 9);
    return f[1] == 0 && f[2] == 0 && f[3] == 0 && f[5] == 0 && f[6] == 0 && f[7] == 0;
  }

  Model& model() { return model_; }

 private:
  bool is_listed() {  // as the first row, if at all
    const std::vector<cl_uint> rows = renderer_.rows().read(queue_);
    return !rows.empty() && rows[0] == 0;
  }

  Queue& queue_;
  HostModel host_;
  Model model_;
  Renderer renderer_;
  Shot shot_;
  ImageGradients v_;
};

// Whether a table, by its index in Parameters::tables(), is shared by all Gaussians.
bool is_shared(const Parameters& p, size_t table) {
  return table > 0 && p.more_specs[table - 1].keys == 0;
}

struct ModelHarm {
  double pixels = 0, gradients = 0, not_finite = 0, cases = 0;
  double reached = 0;  // cases in which the culprit is really at the right; nothing is compared

  void add(const Drawn::Outcome& found, const Drawn::Outcome& clean, const Parameters& p,
           bool reaches) {
    ++cases;
    reached += reaches;
    for (size_t k = 0; k < found.images.size(); ++k) {
      not_finite += count_not_finite(found.images[k]);
      if (!reaches) pixels += changed_at_right(found.images[k], clean.images[k]);
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

// Allowed images for a non-finite value: without the culprit; without the flow it affects, if it
// affects nothing else; with an unrotated culprit; and, for infinite logits and logarithms, as with
// very large ones.
class Exemplars {
 public:
  Exemplars(Queue& queue, Drawn& scene)
      : queue_(queue), scene_(scene), clean_(scene.draw().images) {
    Parameters& p = scene.model().parameters;
    ParameterGroup& opacities = p["logit_opacities"];
    without_ = drawn_with(opacities, 0, {-100});
  }

  // Whether the images of the last draw are allowed.
  bool have(const std::vector<std::vector<float>>& images, ParameterGroup& group, size_t place,
            float poison) {
    if (are(images, without_) || are(images, clean_, kFlow) || scene_.unturned()) return true;
    const std::string& name = group.values.name();
    if (name == "quats_r" || name == "quats")  // one quaternion of a 4D rotation, or the only one
      if (are(images, drawn_with(group, 0, {1, 0, 0, 0}))) return true;
    return std::isinf(poison) && name.find("log") != name.npos &&
           are(images, drawn_with(group, place, {poison > 0 ? 200.f : -200.f}));
  }

 private:
  static constexpr size_t kFlow = 3;
  static bool are(const std::vector<std::vector<float>>& images,
                  const std::vector<std::vector<float>>& others, size_t count = kFlow + 1) {
    for (size_t k = 0; k < count; ++k)
      if (!same_image(images[k], others[k])) return false;
    return true;
  }
  std::vector<std::vector<float>> drawn_with(ParameterGroup& group, size_t place,
                                             const std::vector<float>& changed) {
    const std::vector<float> before = group.values.read(queue_);
    std::vector<float> values = before;
    std::copy(changed.begin(), changed.end(), values.begin() + long(place));
    group.values.write(queue_, values);
    auto images = scene_.draw().images;
    group.values.write(queue_, before);
    return images;
  }

  Queue& queue_;
  Drawn& scene_;
  std::vector<std::vector<float>> clean_, without_;
};

class PoisonedModel {
 public:
  PoisonedModel(Queue& queue, MotionModelKind kind)
      : queue_(queue),
        name_(name_of(kind)),
        scene_(queue, kind),
        exemplars_(queue, scene_),
        clean_(scene_.draw()) {}

  Rows rows() {
    Parameters& p = scene_.model().parameters;
    size_t g = 0;
    for (size_t t = 0; t < p.tables().size(); ++t)
      for (ParameterGroup& group : p.tables()[t]->groups) {
        if (is_shared(p, t))
          poison_shared(group);
        else
          poison_culprit(group, p.tables()[t]->count, clean_.gradients[g]);
        ++g;
      }
    const std::string of = fmt::format("{}, {:.0f} cases: ", name_, harm_.cases);
    Rows rows{{of + "others' pixels changed", harm_.pixels, 0},
              {of + "others' gradients changed", harm_.gradients, 0},
              {of + "non-finite, except the culprit's gradients", harm_.not_finite, 0},
              {of + "drawn with non-finite values", unnamed_, 0},
              {of + "share of cases that affect the others", harm_.reached / harm_.cases, .12},
              {of + "values without effect on the image", unused_, 0}};
    if (shared_ > 0)
      rows.push_back({fmt::format("{}, {:.0f} cases in shared rows: non-finite", name_, shared_),
                      not_finite_, 0});
    return rows;
  }

 private:
  // Every poison in every component of the culprit's rows. gradients: those of the clean model.
  void poison_culprit(ParameterGroup& group, size_t rows, const std::vector<float>& gradients) {
    const Parameters& p = scene_.model().parameters;
    const std::vector<float> before = group.values.read(queue_);
    for (size_t row = 0; row < rows; row += p.count)
      for (size_t place = row * group.width; place < (row + 1) * group.width; ++place) {
        unused_ += gradients[place] == 0;
        for (const float poison : poisons()) {
          const Drawn::Outcome found = draw_with(group, before, place, poison);
          harm_.add(found, clean_, p, std::isfinite(poison) && scene_.reaches());
          if (!std::isfinite(poison))
            unnamed_ += !exemplars_.have(found.images, group, place, poison);
        }
      }
  }
  // Every poison in about forty values of a shared group.
  void poison_shared(ParameterGroup& group) {
    const std::vector<float> before = group.values.read(queue_);
    for (size_t place = 0; place < before.size(); place += std::max<size_t>(1, before.size() / 40))
      for (const float poison : poisons()) {
        for (const auto& image : draw_with(group, before, place, poison).images)
          not_finite_ += count_not_finite(image);
        ++shared_;
      }
  }
  // Restores the group's values afterwards; the renderer keeps what was drawn.
  Drawn::Outcome draw_with(ParameterGroup& group, const std::vector<float>& before, size_t place,
                           float poison) {
    std::vector<float> values = before;
    values[place] = poison;
    group.values.write(queue_, values);
    Drawn::Outcome outcome = scene_.draw();
    group.values.write(queue_, before);
    return outcome;
  }

  Queue& queue_;
  const std::string name_;
  Drawn scene_;
  Exemplars exemplars_;
  const Drawn::Outcome clean_;
  ModelHarm harm_;
  double unused_ = 0, unnamed_ = 0;     // counts over the culprit's values
  double shared_ = 0, not_finite_ = 0;  // cases in shared parameters, and their non-finite pixels
};

Rows every_model(Queue& queue) {  // T29
  Rows rows;
  for (size_t kind = 0; kind < names_of(MotionModelKind{}).size(); ++kind)
    for (Row& row : PoisonedModel(queue, MotionModelKind(kind)).rows())
      rows.push_back(std::move(row));
  return rows;
}

}  // namespace

Tests poison_model_tests() { return {{"T29", "poison in the model", true, every_model}}; }

}  // namespace gflow::stress
