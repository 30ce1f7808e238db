// SPDX-License-Identifier: Apache-2.0
// Linear pieces must render like the model, also when read from a .4dgs file, and must be few.
#include "optim/model/linear_pieces.hpp"

#include "optim/eval/views.hpp"
#include "optim/loss/metrics.hpp"
#include "tests/support/lively_model.hpp"

namespace gflow {
namespace {

constexpr PieceRule kTenASecond{21, 10};

// PSNR between the rendered images of two scenes at one time [dB].
double likeness(Queue& queue, const HostModel& host, const MovingSplats& pieces, double step) {
  const TemporaryFolder folder;
  const Camera camera = orbit_views(host, {0}, "-y")[0].camera;
  write_ply(folder.file("now.ply"), splats_at(pieces, step / kTenASecond.fps));
  const auto image = [&](const HostModel& model, double time) {
    return PlanarImage::from_planes(camera.width, camera.height, drawn(queue, model, time, camera));
  };
  return psnr(image(read_model(folder.file("now.ply")), 0), image(host, step / 20));
}

class EveryCutModel : public testing::TestWithParam<MotionModelKind> {};

TEST_P(EveryCutModel, LooksLikeItselfAlsoFromAFile) {
  Queue queue = test_queue();
  const TemporaryFolder folder;
  const HostModel host = lively_model(GetParam());
  Model model(queue, host);
  PieceRule exact = kTenASecond;
  exact.shift = exact.shape = 1e-5;
  const MovingSplats fine = linear_pieces(queue, model, exact);
  const MovingSplats pieces = linear_pieces(queue, model, kTenASecond);
  EXPECT_LE(pieces.splats.size(), fine.splats.size());
  write_four_dgs(folder.file("a.4dgs"), pieces);
  const MovingSplats back = read_four_dgs(folder.file("a.4dgs"));
  EXPECT_NEAR(back.duration, 2.1, 1e-12);
  for (const double step : {0.0, 6.0, 13.0, 20.0}) {
    EXPECT_GT(likeness(queue, host, fine, step), 75) << step;
    EXPECT_GT(likeness(queue, host, pieces, step), 42) << step;
    EXPECT_GT(likeness(queue, host, back, step), 38) << step;  // 8-bit SH coefficients
  }
  EXPECT_GT(likeness(queue, host, pieces, 7.5), 38);   // shapes stay as they were at 7
  EXPECT_GT(likeness(queue, host, pieces, 20.9), 20);  // the last step is as long
}
INSTANTIATE_TEST_SUITE_P(All, EveryCutModel,
                         testing::Values(MotionModelKind::spacetime, MotionModelKind::native4d,
                                         MotionModelKind::keyframes, MotionModelKind::bases,
                                         MotionModelKind::hexplane, MotionModelKind::nodes),
                         [](const auto& test) { return std::string(name_of(test.param)); });

TEST(LinearPieces, StraightPathsAreOnePieceEach) {
  Queue queue = test_queue();
  const HostModel host = lively_model(MotionModelKind::native4d);
  Model model(queue, host);
  PieceRule rule = kTenASecond;
  rule.shift = rule.shape = 1e-3;
  const MovingSplats pieces = linear_pieces(queue, model, rule);
  std::vector<int> of(host.count, 0);
  for (const MovingSplat& s : pieces.splats) EXPECT_EQ(++of[s.sh_row], 1);
  // Its temporal mean and lifetime are those of the model: 2 model time units are 2 s here.
  EXPECT_NEAR(pieces.splats[0].mean_t, double(host.groups.at("means_t")[pieces.splats[0].sh_row]),
              1e-6);
}

// Pieces of a Gaussian of size 0.1 that always exists.
MovingSplats pieces_of(Queue& queue, float speed, float half_acceleration, float turn) {
  HostModel host;
  host.shape.sh_degree = 0;
  append_gaussian(host, {1, 2, 3}, 0.1f, {0.2f, 0.4f, 0.6f}, speed);
  host.groups["half_accelerations"][1] = half_acceleration;
  host.groups["log_scales"][1] += 0.5f;
  host.groups["turns"][3] = turn;
  Model model(queue, host);
  return linear_pieces(queue, model, {21, 20});
}

TEST(LinearPieces, ArePutWhereAPathBendsOrTurns) {
  Queue queue = test_queue();
  const MovingSplats still = pieces_of(queue, 0, 0, 0), even = pieces_of(queue, 3, 0, 0);
  ASSERT_EQ(still.splats.size(), 1u);
  ASSERT_EQ(even.splats.size(), 1u);
  EXPECT_TRUE(std::isinf(even.splats[0].life));
  EXPECT_EQ(even.splats[0].begin, 0);
  EXPECT_EQ(even.splats[0].end, even.duration);
  EXPECT_NEAR(even.splats[0].velocity[0], 3, 1e-5);
  EXPECT_NEAR(even.splats[0].mean[0], 1 - 0.5 * 3, 1e-5);
  // A chord may deviate from c tau^2 by e on either side: pieces of sqrt(8 e / 2 c) s, here 0.16.
  const MovingSplats bent = pieces_of(queue, 0, 1, 0);
  EXPECT_GE(bent.splats.size(), 4u);
  EXPECT_LE(bent.splats.size(), 10u);
  for (size_t i = 1; i < bent.splats.size(); ++i)
    EXPECT_EQ(bent.splats[i].begin, bent.splats[i - 1].end);
  for (const MovingSplat& s : bent.splats)
    for (double t = s.begin; t < std::min(s.end, 1.0); t += 0.05) {
      const double size = 0.1 * std::exp(0.5 / 3), tau = t - 0.5;
      EXPECT_NEAR(s.mean[1] + s.velocity[1] * (t - s.mean_t), 2 + tau * tau, 0.051 * size) << t;
    }
  // The rotation changes the shape by more than 5 % per step until the end: one piece per step.
  EXPECT_EQ(pieces_of(queue, 0, 0, 5).splats.size(), 21u);
}

TEST(LinearPieces, AreNotMadeOfWhatIsNeverSeen) {
  Queue queue = test_queue();
  HostModel host;
  host.shape.sh_degree = 0;
  for (int i = 0; i < 3; ++i) append_gaussian(host, {1, 2, 3}, 0.1f, {0.2f, 0.4f, 0.6f}, 0);
  for (size_t i = 0; i < 3; ++i) host.groups["log_scales"][4 * i + 3] = std::log(0.1f);
  host.groups["means_t"] = {-0.3f, 0.5f, 1.3f};  // visible for 0.245 before and after
  Model model(queue, host);
  const MovingSplats pieces = linear_pieces(queue, model, {11, 10});
  ASSERT_EQ(pieces.splats.size(), 1u);
  EXPECT_NEAR(pieces.splats[0].begin, 0.2, 1e-12);
  EXPECT_NEAR(pieces.splats[0].end, 0.8, 1e-12);
}

TEST(LinearPieces, OneStepIsAStillImage) {
  Queue queue = test_queue();
  const HostModel host = small_model(true);
  Model model(queue, host);
  const MovingSplats pieces = linear_pieces(queue, model, {1, 24});
  EXPECT_EQ(pieces.splats.size(), host.count);
  EXPECT_EQ(splats_at(pieces, 0).rows, host.count);
  EXPECT_NEAR(pieces.duration, 1 / 24.0, 1e-12);
}

TEST(LinearPieces, RefusesRulesThatAreNone) {
  Queue queue = test_queue();
  Model model(queue, small_model(false));
  expect_error([&] { linear_pieces(queue, model, {0, 24}); }, {"0 and 24"});
  expect_error([&] { linear_pieces(queue, model, {5, 0}); }, {"5 and 0"});
}

}  // namespace
}  // namespace gflow
