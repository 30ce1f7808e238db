// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/cameras_json.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "optim/images/image_header.hpp"
#include "optim/scene/json_file.hpp"
#include "optim/scene/readers/reader_util.hpp"
#include "runtime/base/error.hpp"
#include "runtime/files/json_text.hpp"

namespace gflow {
namespace {

Camera camera_of(const Json& object, const std::string& where) {
  if (!object.is_object()) throw Error(where + " is not a JSON object");
  Camera camera;
  if (object.contains("img_name")) camera.name = text(object["img_name"], "img_name of " + where);
  const double width = needed_number(object, "width", where);
  const double height = needed_number(object, "height", where);
  camera.fx = needed_number(object, "fx", where);
  camera.fy = needed_number(object, "fy", where);
  if (!(width >= 1 && height >= 1 && width <= largest_side && height <= largest_side &&
        camera.fx > 0 && camera.fy > 0))
    throw Error(
        fmt::format("{} has size {}x{} and focal lengths {}, {}: sides must be 1 to {} pixels and "
                    "focal lengths positive",
                    where, width, height, camera.fx, camera.fy, largest_side));
  camera.width = int(width);
  camera.height = int(height);
  camera.cx = number(object, "cx", where).value_or(0.5 * camera.width);
  camera.cy = number(object, "cy", where).value_or(0.5 * camera.height);
  camera.near = std::max(number(object, "near", where).value_or(0), 0.0);
  const std::string pose = "the pose of " + where;
  const std::vector<double> p = numbers(member(object, "position", where), 3, pose);
  const Eigen::MatrixXd rotation = matrix(member(object, "rotation", where), 3, 3, pose);
  camera.viewmat = viewmat_from_pose(rotation, {p[0], p[1], p[2]}, pose);
  return camera;
}

}  // namespace

std::vector<Camera> read_cameras_json(const std::string& path, int resolution) {
  const Json json = read_json(path);
  if (!json.is_array() || json.empty())
    throw Error(fmt::format("cannot read cameras from {}: expected a non-empty JSON list", path));
  std::vector<Camera> cameras;
  for (const Json& object : json)
    cameras.push_back(reduced(
        camera_of(object, fmt::format("camera {} of {}", cameras.size(), path)), resolution));
  return cameras;
}

std::string cameras_json(const std::vector<Camera>& cameras) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (size_t i = 0; i < cameras.size(); ++i) {
    const Camera& c = cameras[i];
    const Eigen::Vector3d p = c.position();
    nlohmann::ordered_json rotation;  // camera to world, as 3DGS viewers expect
    for (int row = 0; row < 3; ++row)
      rotation.push_back({c.viewmat(0, row), c.viewmat(1, row), c.viewmat(2, row)});
    list.push_back({{"id", i},
                    {"img_name", c.name},
                    {"width", c.width},
                    {"height", c.height},
                    {"position", {p.x(), p.y(), p.z()}},
                    {"rotation", rotation},
                    {"fx", c.fx},
                    {"fy", c.fy},
                    {"cx", c.cx},
                    {"cy", c.cy}});
    if (c.near > 0) list.back()["near"] = c.near;
  }
  return json_text(list, 1) + "\n";
}

Camera camera_named(const std::vector<Camera>& cameras, const std::string& name) {
  std::string names;
  for (size_t i = 0; i < cameras.size(); ++i) {
    if (cameras[i].name == name) return cameras[i];
    if (i < 20) names += (i ? ", " : "") + cameras[i].name;
  }
  if (cameras.size() > 20) names += fmt::format(" and {} more", cameras.size() - 20);
  throw Error(fmt::format("there is no camera '{}'; available cameras: {}", name, names));
}

}  // namespace gflow
