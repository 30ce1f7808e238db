// SPDX-License-Identifier: Apache-2.0
// Culling of rows by view (Motion::cull): all Gaussians that the camera renders are kept, with
// bitwise equal poses; most others are culled; and the backward pass finds the parameters of each.
#include <algorithm>
#include <numeric>
#include <random>

#include "optim/engine/engine.hpp"
#include "optim/motion/models.hpp"
#include "optim/reference/device_scene.hpp"
#include "tests/support/compare.hpp"
#include "tests/support/device.hpp"

namespace gflow {
namespace {

// The models that cull by camera; lanes: 0 the device's own, 1 as on GPUs.
class Outside : public testing::TestWithParam<std::tuple<MotionModelKind, int>> {};
INSTANTIATE_TEST_SUITE_P(
    Motion, Outside,
    testing::Combine(testing::Values(MotionModelKind::spacetime, MotionModelKind::native4d,
                                     MotionModelKind::keyframes, MotionModelKind::bases),
                     testing::Values(0, 1)),
    [](const auto& info) {
      const MotionModelKind kind = std::get<0>(info.param);
      return fmt::format("{}_{}", name_of(kind), std::get<1>(info.param));
    });

// Maximum absolute value of a group: needles, large and small Gaussians that cross the view.
float most_of(const GroupSpec& spec) {
  if (spec.quantity == Quantity::opacity) return 6;
  if (spec.quantity == Quantity::scale) return 2.5f;
  if (spec.name == "means") return 10;
  return spec.name == "basis_shifts" || spec.name == "key_shifts" ? 6 : 1.5f;
}

constexpr size_t N_OUTSIDE = 4000, SOME_MOVE = 3015;  // within a group of lanes

// The first Gaussian has no finite position.
void fill_randomly(Queue& queue, Parameters& p) {
  std::mt19937 rng(8);
  const auto random = [&] { return 2 * float(rng()) / 4294967296.f - 1; };
  for (Table* table : p.tables())
    for (size_t g = 0; g < table->groups.size(); ++g) {
      const GroupSpec& spec = table->specs[g];
      std::vector<float> values;
      for (size_t i = 0; i < spec.width * table->count; ++i)
        values.push_back(most_of(spec) * random() -
                         (spec.name == "log_scales" && i % 4 < 3 ? 2 : 0));
      if (spec.name == "means") values[0] = NAN;
      // Quaternions whose squared length overflows or underflows, and zero quaternions.
      if (spec.quantity == Quantity::rotation && spec.width == 4 && table == &p)
        for (size_t i = 0; i < N_OUTSIDE; ++i)
          for (size_t k = 0; k < 4; ++k)
            values[4 * i + k] *= i % 50 == 1 ? 1e19f : i % 50 == 2 ? 3e-8f : 1;
      table->groups[g].values.write(queue, values);
    }
  p.rows.seen.fill(queue, 0u);
}

MotionShape shape_of(MotionModelKind kind) {
  MotionShape shape;
  shape.motion = kind;
  shape.hexplane.times = 16;
  shape.keys = 4;
  shape.key_scales = 1;
  shape.bases = 3;
  return shape;
}

TEST_P(Outside, OnlyWhatTheCameraCannotSeeIsLeftOut) {
  Queue queue = test_queue(std::get<1>(GetParam()));
  const auto motion = make_motion(queue, shape_of(std::get<0>(GetParam())));
  Parameters p(queue, N_OUTSIDE, motion->groups(), motion->tables());
  fill_randomly(queue, p);
  ViewRows view(queue);

  PinholeCamera camera = test_camera(64, 48);
  camera.near_plane = .05f;
  PinholeCamera part = camera;  // a part of a larger image
  part.left = 30;
  part.top = 10;
  part.full_width = 120;
  part.full_height = 90;
  for (const PinholeCamera& c : {camera, part})
    for (const bool boxes : {true, false})
      for (const size_t moving : {N_OUTSIDE, SOME_MOVE}) {
        p.moving = moving;
        EngineSettings settings;
        settings.skip.boxes = boxes;
        Engine engine(queue, settings);
        GaussiansAt all, some;
        motion->at(queue, p, .25f, nullptr, all);
        engine.project(queue, {c, c}, {false, false}, all);
        const std::vector<cl_uint> touched = engine.splats().tiles_touched.read(queue);
        ASSERT_TRUE(motion->cull(queue, p, .25f, c, view));
        view.take_marked(queue, p);
        motion->at(queue, p, .25f, nullptr, some, view.list());
        engine.project(queue, {c, c}, {false, false}, some);
        const std::vector<cl_uint> touched_now = engine.splats().tiles_touched.read(queue);
        const std::vector<float> before = all.opacities.read(queue),
                                 now = some.opacities.read(queue);
        const std::vector<float> shapes = all.factors.read(queue),
                                 shapes_now = some.factors.read(queue);
        const std::vector<cl_uint> rows = view.read(queue);
        ASSERT_EQ(rows.size(), view.count());
        ASSERT_EQ(now.size(), rows.size());
        EXPECT_TRUE(std::is_sorted(rows.begin(), rows.end()));
        EXPECT_EQ(view.moving(),
                  size_t(std::lower_bound(rows.begin(), rows.end(), moving) - rows.begin()));
        size_t there = 0, seen = 0, entry = 0;
        for (size_t i = 0; i < N_OUTSIDE; ++i) {
          there += before[i] > 0;
          seen += touched[i] > 0;
          if (entry == rows.size() || rows[entry] != i) {
            EXPECT_EQ(touched[i], 0u);
            continue;
          }
          EXPECT_EQ(touched_now[entry], touched[i]);
          if (touched[i]) {
            EXPECT_EQ(now[entry], before[i]);
            for (size_t k = 0; k < 9; ++k) EXPECT_EQ(shapes_now[9 * entry + k], shapes[9 * i + k]);
          }
          ++entry;
        }
        EXPECT_GT(seen, 100u);
        EXPECT_GT(there - seen, 1000u);
        EXPECT_LT(rows.size() - seen, (there - seen) / 3);
      }
}

// The rows of v at the entries of a view.
std::vector<float> at_entries(const std::vector<float>& v, const std::vector<cl_uint>& rows) {
  const size_t width = v.size() / N_OUTSIDE;
  std::vector<float> out;
  for (const cl_uint row : rows)
    out.insert(out.end(), v.begin() + long(width * row), v.begin() + long(width * (row + 1)));
  return out;
}

// Gradients through the entries of a view equal those through all rows, each at its own parameters.
// Sums over Gaussians (the shared motions of `bases`) may round differently.
TEST_P(Outside, TheWayBackFindsTheRowsOfItsEntries) {
  Queue queue = test_queue(std::get<1>(GetParam()));
  const auto motion = make_motion(queue, shape_of(std::get<0>(GetParam())));
  Parameters p(queue, N_OUTSIDE, motion->groups(), motion->tables());
  fill_randomly(queue, p);
  p.moving = SOME_MOVE;
  PinholeCamera camera = test_camera(64, 48);
  camera.near_plane = .05f;
  ViewRows view(queue);
  ASSERT_TRUE(motion->cull(queue, p, .25f, camera, view));
  view.take_marked(queue, p);
  const std::vector<cl_uint> rows = view.read(queue);
  ASSERT_GT(rows.size(), 100u);
  std::vector<cl_uint> all_rows_of_it(N_OUTSIDE);
  std::iota(all_rows_of_it.begin(), all_rows_of_it.end(), 0u);

  std::mt19937 rng(9);
  std::vector<float> v_means(3 * N_OUTSIDE), v_factors(9 * N_OUTSIDE), v_opacities(N_OUTSIDE);
  for (std::vector<float>* v : {&v_means, &v_factors, &v_opacities})
    for (float& x : *v) x = 2 * float(rng()) / 4294967296.f - 1;
  const auto gradients = [&](const std::vector<cl_uint>& entries, const RowList& list) {
    std::vector<cl_uint> touched;  // every third listed row is not rendered; no other row is
    for (const cl_uint row : entries)
      touched.push_back(row % 3 != 1 && std::binary_search(rows.begin(), rows.end(), row));
    const auto upload = [&](const std::vector<float>& v) {
      return Buffer<float>(queue, at_entries(v, entries), "v");
    };
    const Buffer<cl_uint> seen(queue, touched, "tiles_touched");
    const Buffer<float> means = upload(v_means), factors = upload(v_factors);
    const Buffer<float> opacities = upload(v_opacities);
    p.forget_seen(queue);
    for (Table* table : p.tables())
      for (ParameterGroup& group : table->groups) group.grads.fill(queue, 0);
    motion->backward(queue, p, .25f, true, seen, means, factors, opacities, list);
    const auto movers = std::lower_bound(entries.begin(), entries.end(), cl_uint(SOME_MOVE));
    motion->backward(queue, p, .5f, false, seen, means, factors, opacities,
                     {size_t(movers - entries.begin()), list.rows});
    FloatArrays out;
    for (Table* table : p.tables())
      for (ParameterGroup& group : table->groups)
        out[group.values.name()] = group.grads.read(queue);
    for (const cl_uint row : p.rows.seen.read(queue)) out["seen"].push_back(float(row));
    return out;
  };
  const FloatArrays listed = gradients(rows, view.list());
  const FloatArrays whole = gradients(all_rows_of_it, {});
  EXPECT_EQ(listed.at("seen"), whole.at("seen"));
  for (const auto& [name, expected] : whole) {
    EXPECT_LT(relative_l2(listed.at(name), expected), 1e-5) << name;
    EXPECT_TRUE(norm(expected) > 0 || name == "pivots") << name;
  }
}

}  // namespace
}  // namespace gflow
