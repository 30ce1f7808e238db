// SPDX-License-Identifier: Apache-2.0
#include "apps/python/bind_scenes.hpp"

#include <pybind11/stl.h>

#include "apps/python/rasterization.hpp"
#include "optim/flow/optical_flow.hpp"
#include "optim/images/image.hpp"
#include "runtime/base/warning.hpp"

namespace py = pybind11;

namespace gflow::python {
namespace {

using Bytes = py::array_t<uint8_t, py::array::c_style>;

py::array_t<uint8_t> pixels_of(const Image& image) {
  return array_of<uint8_t>({image.height, image.width, image.channels}, image.pixels);
}

Image image_of(const Bytes& array) {
  return {int(array.shape(1)), int(array.shape(0)), int(array.shape(2)),
          std::vector<uint8_t>(array.data(), array.data() + array.size())};
}

py::tuple flow_and_mask(const FlowField& flow, const std::vector<uint8_t>& known) {
  py::array_t<bool> mask(Shape{flow.height, flow.width});
  std::transform(known.begin(), known.end(), mask.mutable_data(), [](uint8_t x) { return x > 0; });
  return py::make_tuple(array_of<float>({flow.height, flow.width, 2}, flow.uv), mask);
}

// The fields of a gflow.View, besides its scene.
py::dict view_fields(const Frame& frame, const PyScene& scene) {
  py::dict fields;
  fields["name"] = frame.name;
  fields["camera"] = fields_of(scene.loaded.frames->camera(frame));
  fields["time"] = frame.time;
  fields["step"] = frame.step;
  fields["track"] = frame.track;
  return fields;
}

const Frame& frame_at(const PyScene& scene, const std::string& split, size_t index) {
  return frames_of_split(scene.loaded.scene, split).at(index);
}

py::list views(const PyScene& scene, const std::string& split) {
  const Scene& s = scene.loaded.scene;
  py::list list;
  for (const Frame& frame : split == "train" ? s.train : split == "val" ? s.val : s.test)
    list.append(view_fields(frame, scene));
  return list;
}

py::array_t<uint8_t> image(const PyScene& scene, const std::string& split, size_t index) {
  std::shared_ptr<const Image> image;
  {
    const py::gil_scoped_release unlocked;
    image = scene.loaded.frames->image(frame_at(scene, split, index));
  }
  return pixels_of(*image);
}

// The scene's true flow from this view, in the size of its image: vectors, where they are known,
// and the time that they lead to; None if it has none.
py::object true_flow(const PyScene& scene, const std::string& split, size_t index) {
  const Frame& frame = frame_at(scene, split, index);
  if (frame.flow_path.empty()) return py::none();
  TargetFlow flow;
  {
    const py::gil_scoped_release unlocked;
    flow.flow = read_flo(frame.flow_path);
    flow.confidence = flow.flow.valid;
    const Camera& camera = scene.loaded.frames->camera(frame);
    flow = resized(flow, camera.width, camera.height);
  }
  return flow_and_mask(flow.flow, flow.flow.valid) + py::make_tuple(frame.flow_time);
}

py::dict points(const PyScene& scene) {
  const PointCloud& points = scene.loaded.scene.points;
  const py::ssize_t n = py::ssize_t(points.size());
  py::dict arrays;
  arrays["means"] = array_of<double>({n, 3}, points.xyz);
  arrays["rgb"] = points.rgb.empty() ? py::object(py::none())
                                     : py::object(array_of<uint8_t>({n, 3}, points.rgb));
  return arrays;
}

// Of the camera, which is added unless the track has one in that pose already: a camera at rest.
int camera_index(Scene& scene, Camera camera, int track) {
  if (camera.name.empty()) camera.name = fmt::format("cam{:02}", track);
  for (size_t i = scene.cameras.size(); i-- > 0;) {
    const Camera& other = scene.cameras[i];
    if (other.name == camera.name && other.viewmat == camera.viewmat && other.fx == camera.fx &&
        other.fy == camera.fy && other.cx == camera.cx && other.cy == camera.cy &&
        other.width == camera.width && other.height == camera.height)
      return int(i);
  }
  scene.cameras.push_back(std::move(camera));
  return int(scene.cameras.size()) - 1;
}

// A scene of views in memory. Each is a dict: image (uint8 [H, W, 3 or 4]), camera (a
// gflow.Camera), time, track and split. points: float64 [P, 3], colors: uint8 [P, 3], or both None.
std::shared_ptr<PyScene> scene_of(const py::list& views, const py::object& points,
                                  const py::object& colors, double fps,
                                  const std::vector<std::string>& settings) {
  Scene scene;
  scene.name = "arrays";
  scene.fps = fps;
  for (const py::handle view : views) {
    const auto item = py::cast<py::dict>(view);
    Frame frame;
    frame.track = py::cast<int>(item["track"]);
    frame.camera = camera_index(scene, camera_from(item["camera"]), frame.track);
    frame.time = py::cast<double>(item["time"]);
    auto image = std::make_shared<Image>(image_of(py::cast<Bytes>(item["image"])));
    scene.has_alpha |= image->channels == 4;
    frame.image = std::move(image);
    const auto split = py::cast<std::string>(item["split"]);
    (split == "train" ? scene.train
     : split == "val" ? scene.val
                      : scene.test)
        .push_back(std::move(frame));
  }
  if (!points.is_none()) {
    const auto xyz = py::cast<py::array_t<double, py::array::c_style>>(points);
    scene.points.xyz.assign(xyz.data(), xyz.data() + xyz.size());
    const auto rgb = py::cast<Bytes>(colors);
    scene.points.rgb.assign(rgb.data(), rgb.data() + rgb.size());
  }
  TrainOptions options;
  apply_settings(options, settings);
  const py::gil_scoped_release unlocked;
  complete_scene(scene, options.scene);
  auto made = std::make_shared<PyScene>();
  made->options = options.scene;
  made->in_memory = true;
  made->loaded = with_frames(std::move(scene), options.scene, "");
  return made;
}

std::shared_ptr<PyScene> read(const std::string& path, const std::vector<std::string>& settings) {
  TrainOptions options;
  apply_settings(options, settings);
  options.scene.path = std::filesystem::absolute(path).lexically_normal().string();
  check(options);
  auto scene = std::make_shared<PyScene>();
  std::vector<std::string> said;
  {
    const py::gil_scoped_release unlocked;
    const WarningsTo warnings([&](const std::string& sentence) { said.push_back(sentence); });
    scene->options = options.scene;
    scene->loaded = load_scene(options.scene, "");
  }
  for (const std::string& sentence : said)
    if (PyErr_WarnEx(PyExc_RuntimeWarning, sentence.c_str(), 1) != 0) throw py::error_already_set();
  return scene;
}

py::tuple optical_flow(const Bytes& a, const Bytes& b) {
  TargetFlow flow;
  {
    const Image first = image_of(a), second = image_of(b);
    const py::gil_scoped_release unlocked;
    flow = estimate_target_flows(first, second, CameraMotion::any).first;
  }
  return flow_and_mask(flow.flow, flow.confidence);
}

}  // namespace

void apply_settings(TrainOptions& options, const std::vector<std::string>& settings) {
  for (const std::string& setting : settings) try {
      apply_setting(options, setting);
    } catch (const Error& problem) {
      const std::string text = problem.what(), option = "--set ";
      throw InputError(text.rfind(option, 0) == 0 ? text.substr(option.size()) : text);
    }
}

void bind_scenes(py::module_& m) {
  const auto value = [](auto Scene::*field) {
    return [field](const PyScene& scene) { return scene.loaded.scene.*field; };
  };
  py::class_<PyScene, std::shared_ptr<PyScene>>(m, "Scene")
      .def_static("read", &read, py::arg("path"), py::arg("settings"))
      .def_static("of", &scene_of, py::arg("views"), py::arg("points"), py::arg("colors"),
                  py::arg("fps"), py::arg("settings"))
      .def_property_readonly("name", value(&Scene::name))
      .def_property_readonly("layout", value(&Scene::layout))
      .def_property_readonly("steps", value(&Scene::steps))
      .def_property_readonly("fps", value(&Scene::fps))
      .def_property_readonly("extent", value(&Scene::extent))
      .def_property_readonly("near_plane", value(&Scene::near_plane))
      .def_property_readonly("origin", value(&Scene::origin))
      .def_property_readonly("notices", value(&Scene::notices))
      .def_property_readonly("path", [](const PyScene& scene) { return scene.options.path; })
      .def("views", &views, py::arg("split"))
      .def("image", &image, py::arg("split"), py::arg("index"))
      .def("true_flow", &true_flow, py::arg("split"), py::arg("index"))
      .def("points", &points);
  m.def("optical_flow", &optical_flow, py::arg("a"), py::arg("b"));
}

}  // namespace gflow::python
