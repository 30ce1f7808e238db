// SPDX-License-Identifier: Apache-2.0
// T40, T41: trainings with density control that must be equal in every bit when repeated, on a busy
// machine, and after resuming; and one that breaks and rolls back.
#include <atomic>
#include <future>
#include <thread>

#include "apps/stress/errors.hpp"
#include "apps/stress/stress.hpp"
#include "apps/stress/training/small_training.hpp"
#include "optim/runs/roll_back.hpp"

namespace gflow::stress {
namespace {

using Bits = std::map<std::string, std::vector<uint32_t>>;

TrainOptions config_of(const SmallScene& scene, int steps) {
  TrainOptions config = small_config(scene, steps);
  config.init.dynamic = 60;
  config.density.stop_fraction = .9f;
  return config;
}

// FNV-1a over names and bits.
uint64_t hash(const Bits& bits) {
  uint64_t h = 1469598103934665603ull;
  const auto add = [&](uint64_t x) { h = (h ^ x) * 1099511628211ull; };
  for (const auto& [name, values] : bits) {
    for (const char c : name) add(uint64_t(c));
    for (const uint32_t v : values) add(v);
  }
  return h;
}

// Hashes after every hundred steps.
std::vector<uint64_t> hashes(Queue& queue, const TrainOptions& config, int steps, size_t* count) {
  SmallTraining training(queue, config);
  std::vector<uint64_t> found;
  for (int done = 0; done < steps; done += 100) {
    training.steps(queue, 100);
    const Bits bits = training.bits(queue);
    found.push_back(hash(bits));
    if (count) *count = bits.at("gaussians/means_t").size();
  }
  return found;
}

// Threads that keep all cores busy while this object exists.
class Load {
 public:
  Load() {
    for (unsigned i = 0; i < std::max(2u, std::thread::hardware_concurrency()); ++i)
      threads_.emplace_back([this] {
        volatile double x = 1;
        while (!stop_) x = x * 1.0000001;
      });
  }
  ~Load() {
    stop_ = true;
    for (std::thread& t : threads_) t.join();
  }

 private:
  std::atomic<bool> stop_{false};
  std::vector<std::thread> threads_;
};

double different(const std::vector<uint64_t>& a, const std::vector<uint64_t>& b) {
  double count = std::fabs(double(a.size()) - double(b.size()));
  for (size_t i = 0; i < std::min(a.size(), b.size()); ++i) count += a[i] != b[i];
  return count;
}

Rows repeated(Queue& queue, int steps) {  // T40
  const SmallScene scene(queue);
  const TrainOptions config = config_of(scene, steps);
  size_t grown = 0;
  const std::vector<uint64_t> first = hashes(queue, config, steps, &grown);
  const std::vector<uint64_t> second = hashes(queue, config, steps, nullptr);
  double busy = 0;
  {
    const Load load;
    auto beside = std::async(std::launch::async, [&] {
      Queue other(queue.device, {false, queue.lanes});  // compiles its programs again, too
      return hashes(other, config, steps, nullptr);
    });
    busy = different(first, hashes(queue, config, steps, nullptr));
    busy += different(first, beside.get());
  }
  TrainOptions seeded = config;
  ++seeded.train.seed;
  const std::vector<uint64_t> unlike = hashes(queue, seeded, 100, nullptr);
  const std::string of = fmt::format("{} steps, differing hashes of {}: ", steps, first.size());
  return {{of + "run again", different(first, second), 0},
          {of + "with another training on a busy machine", busy, 0},
          {"Gaussians at the start / at the end", 60. / double(grown), .999},
          {"equal hashes of another seed", double(unlike[0] == first[0]), 0}};
}

Rows resumed(Queue& queue, int times) {  // T41
  const SmallScene scene(queue);
  constexpr int steps = 300;
  const TrainOptions config = config_of(scene, steps);
  SmallTraining whole(queue, config);
  whole.steps(queue, steps);
  const uint64_t expected = hash(whole.bits(queue));
  Random random(41);
  double wrong = 0;
  for (int i = 0; i < times; ++i) {
    const int at = int(random.uniform(1, steps));
    Arrays state;
    {
      SmallTraining cut(queue, config);
      cut.steps(queue, at);
      state = cut.trainer.state(queue);
    }
    SmallTraining resumed(queue, config);
    resumed.go_on(queue, state, at);
    resumed.steps(queue, steps - at);
    wrong += hash(resumed.bits(queue)) != expected;
  }
  return {{fmt::format("{} stops at a random step: different hashes", times), wrong, 0}};
}

double not_finite_in(const Arrays& arrays) {
  double count = 0;
  for (const auto& [name, array] : arrays)
    if (const auto* values = std::get_if<std::vector<float>>(&array.values))
      count += count_not_finite(*values);
  return count;
}

// Colours too large for a sum over an image, and a NaN position: training rolls back to the
// checkpoint and continues.
Rows gone_back(Queue& queue) {  // T41
  const SmallScene scene(queue);
  constexpr int saved = 20, steps = 100;
  const TrainOptions config = config_of(scene, steps);
  SmallTraining training(queue, config);
  const ScratchFolder folder("stress");
  const RunFolder run = RunFolder::create(folder.path() + "/run");
  Checkpointer checkpoints(queue, config, training.loaded.scene, run, training.trainer,
                           training.model.shape);
  RollBack roll_back(queue, run, training.trainer, checkpoints);
  training.steps(queue, saved);
  checkpoints.write(saved, 0);
  Bits kept = training.bits(queue);
  training.model.parameters["sh0"].values.fill(queue, 3e37f);
  training.model.parameters["means"].values.fill_range(queue, 0, 1, std::nanf(""));
  training.steps(queue, 1);
  const StepReport broken = training.trainer.report(queue);
  StepReport loss_alone;
  loss_alone.loss = broken.loss;
  std::string notice;
  const int back = roll_back.roll_back(saved + 1, broken, notice);
  Bits now = training.bits(queue);
  for (Bits* bits : {&kept, &now}) bits->erase("caution");  // halved learning rates from here on
  training.go_on(queue, training.trainer.state(queue), back);
  training.steps(queue, steps - back);
  const StepReport report = training.trainer.report(queue);
  return {
      {"non-finite loss: not detected",
       double(std::isfinite(broken.loss)) + double(is_finite_report(loss_alone, {})), 0},
      {"rolled back: steps from the checkpoint", std::fabs(double(back - saved)), 0},
      {"rolled back: bits differ from the checkpoint", double(hash(now) != hash(kept)), 0},
      {"continued to step 100: non-finite values", not_finite_in(training.trainer.state(queue)), 0},
      {"continued to step 100: diverged", double(!is_finite_report(report, {})), 0}};
}

}  // namespace

Tests training_tests() {
  return {{"T40", "training repeated", true, [](Queue& q) { return repeated(q, 300); }},
          {"T40", "the same, 2000 steps", false, [](Queue& q) { return repeated(q, 2000); }},
          {"T41", "training resumed", true, [](Queue& q) { return resumed(q, 1); }},
          {"T41", "the same, 20 times", false, [](Queue& q) { return resumed(q, 20); }},
          {"T41", "training rolled back", true, gone_back}};
}

}  // namespace gflow::stress
