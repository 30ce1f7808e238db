// SPDX-License-Identifier: Apache-2.0
// Generates a scene as large as the published recordings, to measure memory, disk and time:
//   large_scene FOLDER [CAMERAS [STEPS [WIDTH HEIGHT]]]        default: 20 300 1352 1014
// N3V layout: a textured wall, and in front of it a textured board that moves and rotates in its
// plane, seen by cameras on an arc, as JPEG with sensor noise. About 0.4 MB per image.
#include <fmt/format.h>

#include <Eigen/Dense>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <thread>
#include <vector>

#include "optim/formats/npy.hpp"
#include "optim/formats/ply.hpp"
#include "runtime/base/error.hpp"

namespace {
using namespace gflow;

constexpr double wall_z = 1, board_z = 0.4;  // the cameras are at z = -3 and look along +z
constexpr double wall_side = 10, board_side = 0.8;
constexpr int texture_side = 2048;  // [px]

struct View {
  Eigen::Matrix3d axes;  // columns: right, down, ahead
  Eigen::Vector3d position;
  double focal;  // [px]
};

View view_of(int camera, int cameras, int width) {
  const double angle = cameras > 1 ? (double(camera) / (cameras - 1) - 0.5) : 0;  // [rad]
  View view;
  view.position = {-3 * std::sin(angle), 0.3 * std::cos(7 * angle), -3 * std::cos(angle)};
  const Eigen::Vector3d ahead = -view.position.normalized();
  const Eigen::Vector3d right = Eigen::Vector3d::UnitY().cross(ahead).normalized();
  view.axes << right, ahead.cross(right), ahead;
  view.focal = 1.1 * width;
  return view;
}

// Coarse and fine speckles, so that flow is well defined at every scale.
cv::Mat texture(uint64_t seed) {
  cv::RNG random(seed);
  cv::Mat sum(texture_side, texture_side, CV_32FC3, cv::Scalar::all(128));
  for (int cells = 16; cells <= texture_side; cells *= 4) {
    cv::Mat speckles(cells, cells, CV_32FC3), large;
    random.fill(speckles, cv::RNG::NORMAL, 0, 22);
    cv::resize(speckles, large, sum.size(), 0, 0, cv::INTER_CUBIC);
    sum += large;
  }
  sum.convertTo(sum, CV_8UC3);
  return sum;
}

// Maps pixels of a square texture in the plane z, rotated by `angle` about its centre (x, y), to
// pixels of the image: K [R | t] restricted to the plane.
cv::Mat plane_to_image(const View& view, int width, int height, double side, double x, double y,
                       double z, double angle) {
  const double s = side / texture_side, c = s * std::cos(angle), d = s * std::sin(angle);
  const double half = texture_side / 2.0;
  Eigen::Matrix3d world;  // of texture pixel (u, v, 1)
  world << c, -d, x - c * half + d * half, d, c, y - d * half - c * half, 0, 0, z;
  world.col(2) -= view.position;
  Eigen::Matrix3d intrinsics;
  intrinsics << view.focal, 0, width / 2.0, 0, view.focal, height / 2.0, 0, 0, 1;
  const Eigen::Matrix3d h = intrinsics * view.axes.transpose() * world;
  cv::Mat result(3, 3, CV_64F);
  for (int r = 0; r < 3; ++r)
    for (int k = 0; k < 3; ++k) result.at<double>(r, k) = h(r, k);
  return result;
}

// The position of the board at fraction t of the video.
Eigen::Vector3d board_at(double t) {
  return {0.9 * std::sin(6 * t), 0.5 * std::sin(9 * t), board_z};
}

void write_camera(const std::string& folder, int camera, const View& view, int steps, int width,
                  int height, const std::vector<cv::Mat>& textures) {
  cv::RNG random(uint64_t(camera) + 100);
  cv::Mat empty, noise(height + 64, width + 64, CV_16SC3);
  random.fill(noise, cv::RNG::NORMAL, 0, 1.5);
  cv::warpPerspective(textures[0], empty,
                      plane_to_image(view, width, height, wall_side, 0, 0, wall_z, 0),
                      {width, height}, cv::INTER_AREA, cv::BORDER_REFLECT);
  for (int step = 0; step < steps; ++step) {
    const double t = double(step) / std::max(steps - 1, 1);
    const Eigen::Vector3d at = board_at(t);
    cv::Mat image = empty.clone(), sum;
    cv::warpPerspective(
        textures[1], image,
        plane_to_image(view, width, height, board_side, at.x(), at.y(), at.z(), 8 * t),
        {width, height}, cv::INTER_LINEAR, cv::BORDER_TRANSPARENT);
    const cv::Rect part(random.uniform(0, 64), random.uniform(0, 64), width, height);
    cv::add(image, noise(part), sum, cv::noArray(), CV_8UC3);
    const std::string path = fmt::format("{}/cam{:02}/images/{:04}.jpg", folder, camera, step);
    if (!cv::imwrite(path, sum, {cv::IMWRITE_JPEG_QUALITY, 90}))
      throw Error("cannot write " + path);
  }
}

void write_points(const std::string& folder) {
  cv::RNG random(7);
  PointCloud points;
  for (int i = 0; i < 20000; ++i) {
    const bool board = i % 10 == 0;
    const double side = board ? board_side : wall_side / 2;
    const Eigen::Vector3d centre = board ? board_at(0) : Eigen::Vector3d(0, 0, wall_z);
    const float half = float(side / 2);
    points.xyz.push_back(float(centre.x()) + random.uniform(-half, half));
    points.xyz.push_back(float(centre.y()) + random.uniform(-half, half));
    points.xyz.push_back(float(centre.z()));
    for (int c = 0; c < 3; ++c) points.rgb.push_back(128);
  }
  write_point_cloud(folder + "/points3D.ply", points);
}

void make_scene(const std::string& folder, int cameras, int steps, int width, int height) {
  const std::vector<cv::Mat> textures = {texture(1), texture(2)};
  std::vector<double> poses;  // rows of [down right backwards position size], near, far
  for (int i = 0; i < cameras; ++i) {
    std::filesystem::create_directories(fmt::format("{}/cam{:02}/images", folder, i));
    const View view = view_of(i, cameras, width);
    const double size[3] = {double(height), double(width), view.focal};
    for (int r = 0; r < 3; ++r)
      poses.insert(poses.end(),
                   {view.axes(r, 1), view.axes(r, 0), -view.axes(r, 2), view.position[r], size[r]});
    poses.insert(poses.end(), {1, 10});
  }
  write_npy(folder + "/poses_bounds.npy", {{size_t(cameras), 17}, poses});
  write_points(folder);
  cv::setNumThreads(1);
  std::atomic<int> next{0};
  std::vector<std::thread> workers;
  for (unsigned w = 0; w < std::max(1u, std::thread::hardware_concurrency()); ++w)
    workers.emplace_back([&] {
      for (int i; (i = next++) < cameras;)
        write_camera(folder, i, view_of(i, cameras, width), steps, width, height, textures);
    });
  for (std::thread& worker : workers) worker.join();
}

}  // namespace

int main(int count, char** words) {
  const auto number = [&](int i, int otherwise) {
    return count > i ? std::atoi(words[i]) : otherwise;
  };
  const int cameras = number(2, 20), steps = number(3, 300);
  const int width = number(4, 1352), height = number(5, 1014);
  if (count < 2 || cameras < 1 || steps < 1 || width < 16 || height < 16) {
    std::fprintf(stderr, "usage: large_scene FOLDER [CAMERAS [STEPS [WIDTH HEIGHT]]]\n");
    return 1;
  }
  try {
    make_scene(words[1], cameras, steps, width, height);
  } catch (const std::exception& problem) {
    std::fprintf(stderr, "large_scene: %s\n", problem.what());
    return 1;
  }
  return 0;
}
