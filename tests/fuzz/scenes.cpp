// SPDX-License-Identifier: Apache-2.0
// Scenes of several files.
#include "optim/eval/track_error.hpp"
#include "optim/flow/flow_store.hpp"
#include "optim/formats/flo.hpp"
#include "optim/formats/npz.hpp"
#include "optim/scene/depth_map.hpp"
#include "optim/scene/readers/colmap_model.hpp"
#include "optim/scene/readers/readers.hpp"
#include "tests/fuzz/inputs.hpp"

namespace gflow::fuzz {
namespace {

// A COLMAP model as text, because the binary files are too large for a fuzzer, with its images.
const Files& colmap_files() {
  static const Files files{
      {"sparse/0/cameras.txt", "1 SIMPLE_RADIAL 8 6 10 4 3 -0.1\n2 PINHOLE 8 6 10 11 4 3\n"},
      {"sparse/0/images.txt",
       "1 1 0 0 0 0 0 5 1 a.png\n4.5 3.5 7 1 1 -1\n2 0.7 0.1 0 0.7 0.5 0 5 2 b.png\n\n"},
      {"sparse/0/points3D.txt", "7 0.25 0.25 0 10 20 30 0.5 1 0\n"},
      {"images/a.png", png(8, 6)},
      {"images/b.png", png(8, 6)},
      {"masks/a.png", png(8, 6, 1)}};
  return files;
}
void colmap(const uint8_t* bytes, size_t size) {
  in_scene(bytes, size, "colmap", colmap_files(),
           [](const std::string& path) { read_colmap(path, {}); });
}
void colmap_seeds(const std::string& to) {
  seeds_of(to, colmap_files());
  for (size_t i = 0; i < 3; ++i)
    seed(to, fmt::format("capture_{}", i),
         std::string(1, char(i)) + capture("colmap/" + colmap_files()[i].name));
}

template <class T>
std::string raw(T value) {
  return {reinterpret_cast<const char*>(&value), sizeof value};
}
const Files& colmap_binary_files() {
  static const Files files = [] {
    std::string cameras =
        raw(uint64_t(1)) + raw(uint32_t(7)) + raw(int32_t(4)) + raw(uint64_t(8)) + raw(uint64_t(6));
    for (const double p : {10., 10., 4., 3., -.1, .02, .003, .004}) cameras += raw(p);
    std::string images = raw(uint64_t(1)) + raw(uint32_t(2));
    for (const double p : {1., 0., 0., 0., 0., 0., 5.}) images += raw(p);
    images += raw(uint32_t(7)) + std::string("b.png") + '\0' + raw(uint64_t(1)) + raw(1.5) +
              raw(2.5) + raw(uint64_t(1));
    const std::string points = raw(uint64_t(1)) + raw(uint64_t(1)) + raw(0.5) + raw(-1.0) +
                               raw(2.0) + "\x0a\x14\x1e" + raw(0.1) + raw(uint64_t(1)) +
                               raw(uint32_t(2)) + raw(uint32_t(0));
    return Files{{"cameras.bin", cameras}, {"images.bin", images}, {"points3D.bin", points}};
  }();
  return files;
}
void colmap_binary(const uint8_t* bytes, size_t size) {
  in_scene(bytes, size, "colmap_binary", colmap_binary_files(),
           [](const std::string& path) { read_colmap_model(path); });
}
void colmap_binary_seeds(const std::string& to) {
  seeds_of(to, colmap_binary_files());
  const Files& files = colmap_binary_files();
  for (size_t i = 0; i < files.size(); ++i)
    real_seed(to, "dynerf_flame_steak_5v/sparse/0/" + files[i].name, std::string(1, char(i)));
}

const Files& nerfies_files() {
  static const Files files{
      {"dataset.json", capture("nerfies/dataset.json")},
      {"metadata.json", capture("nerfies/metadata.json")},
      {"scene.json", capture("nerfies/scene.json")},
      {"camera/000004.json", capture("nerfies/camera/000004.json")},
      {"points.npy", written("s.npy",
                             [](const std::string& p) {
                               write_npy(p, {{2, 3}, std::vector<float>(6, 1.f)});
                             })},
      {"camera/000005.json", capture("nerfies/camera/000005.json")},
      {"camera/000006.json", capture("nerfies/camera/000006.json")},
      {"rgb/8x/000004.png", png(60, 107)},
      {"rgb/8x/000005.png", png(60, 107)},
      {"rgb/8x/000006.png", png(60, 107)}};
  return files;
}
void nerfies(const uint8_t* bytes, size_t size) {
  in_scene(bytes, size, "nerfies", nerfies_files(),
           [](const std::string& path) { read_nerfies(path, {}); });
}
void nerfies_seeds(const std::string& to) { seeds_of(to, nerfies_files()); }

const Files& panoptic_files() {
  static const Files files = [] {
    Files all{{"train_meta.json", capture("panoptic/train_meta.json")}};
    for (const int camera : {1, 3, 5, 8})
      for (const int t : {0, 1})
        all.push_back({fmt::format("ims/{}/{:06}.jpg", camera, t), png(64, 36)});
    all.push_back(
        {"init_pt_cld.npz", written("s.npz", [](const std::string& p) {
           write_npz(p, {{"data", {{2, 7}, std::vector<double>(14, .5)}}}, Packing::stored);
         })});
    return all;
  }();
  return files;
}
void panoptic(const uint8_t* bytes, size_t size) {
  in_scene(bytes, size, "panoptic", panoptic_files(),
           [](const std::string& path) { read_panoptic(path, {}); });
}
void panoptic_seeds(const std::string& to) { seeds_of(to, panoptic_files()); }

const Files& nerfstudio_files() {
  static const Files files{{"transforms.json", capture("nerfstudio/transforms.json")},
                           {"images/0001.jpg", png(54, 96)},
                           {"images/0012.jpg", png(54, 96)},
                           {"images/0024.jpg", png(54, 96)}};
  return files;
}
void nerfstudio(const uint8_t* bytes, size_t size) {
  in_scene(bytes, size, "nerfstudio", nerfstudio_files(),
           [](const std::string& path) { read_nerfstudio(path, {}); });
}
void nerfstudio_seeds(const std::string& to) { seeds_of(to, nerfstudio_files()); }

const Files& blender_files() {
  static const std::string frames =
      R"({"camera_angle_x": 0.7, "frames": [{"file_path": "./train/r_000", "time": 0.0,
          "transform_matrix": [[1,0,0,0],[0,1,0,2],[0,0,1,3],[0,0,0,1]]}]})";
  static const Files files{{"transforms_train.json", frames},
                           {"transforms_test.json", frames},
                           {"train/r_000.png", png(8, 6, 4)}};
  return files;
}
void blender(const uint8_t* bytes, size_t size) {
  in_scene(bytes, size, "blender", blender_files(),
           [](const std::string& path) { read_blender(path, {}); });
}
void blender_seeds(const std::string& to) {
  seeds_of(to, blender_files());
  real_seed(to, "dnerf_mujoco/scene10_texture/transforms_test.json", std::string(1, 1));
}

const Files& n3v_files() {
  static const Files files = [] {
    std::vector<double> poses;
    for (int camera = 0; camera < 2; ++camera)
      for (const double p :
           {1., 0., 0., double(camera), 6., 0., 1., 0., 0., 8., 0., 0., 1., 3., 10., 0.1, 20.})
        poses.push_back(p);
    Files all{{"poses_bounds.npy", written("s.npy", [&](const std::string& p) {
                 write_npy(p, {{2, 17}, poses});
               })}};
    for (const char* camera : {"cam00", "cam01"})
      for (const char* frame : {"0000", "0001"})
        all.push_back({fmt::format("{}/images/{}.png", camera, frame), png(8, 6)});
    return all;
  }();
  return files;
}
void n3v(const uint8_t* bytes, size_t size) {
  in_scene(bytes, size, "n3v", n3v_files(), [](const std::string& path) { read_n3v(path, {}); });
}
void n3v_seeds(const std::string& to) {
  seeds_of(to, n3v_files());
  real_seed(to, "dynerf_flame_steak_5v/poses_bounds.npy", std::string(1, 0));
}

// With ground truth: flow, depth, tracks.
const Files& consistent4d_files() {
  static const Files files{
      {"input/0.png", png(8, 6, 4)},
      {"input/1.png", png(8, 6, 4)},
      {"eval_0/0.png", png(8, 6)},
      {"eval_0/1.png", png(8, 6)},
      {"flow/input/0000.flo",
       written("s.flo", [](const std::string& p) { write_flo(p, zero_flow(8, 6)); })},
      {"flow/input/0000_mask.png", png(8, 6, 1)},
      {"depth/input/0000.npy", written("s.npy",
                                       [](const std::string& p) {
                                         write_npy(p, {{6, 8}, std::vector<float>(48, 1.f)});
                                       })},
      {"tracks3d.npy", written("s.npy", [](const std::string& p) {
         write_npy(p, {{2, 3, 3}, std::vector<float>(18, 1.f)});
       })}};
  return files;
}
void consistent4d(const uint8_t* bytes, size_t size) {
  in_scene(bytes, size, "consistent4d", consistent4d_files(), [](const std::string& path) {
    const Scene scene = read_consistent4d(path, {});
    const Frame& frame = scene.train.at(0);
    read_image(frame.path);
    may_refuse([&] { read_true_flow(frame, 8, 6); });
    may_refuse([&] { read_depth_map(frame, scene.cameras.at(size_t(frame.camera)), 8, 6, {}); });
    read_tracks(path + "/tracks3d.npy");
  });
}
void consistent4d_seeds(const std::string& to) { seeds_of(to, consistent4d_files()); }

}  // namespace

std::vector<Target> scene_targets() {
  return {{"colmap", colmap, colmap_seeds, held<colmap_files>},
          {"colmap_binary", colmap_binary, colmap_binary_seeds, its_size},
          {"nerfies", nerfies, nerfies_seeds, held<nerfies_files>},
          {"panoptic", panoptic, panoptic_seeds, held<panoptic_files>},
          {"nerfstudio", nerfstudio, nerfstudio_seeds, held<nerfstudio_files>},
          {"blender", blender, blender_seeds, held<blender_files>},
          {"n3v", n3v, n3v_seeds, held<n3v_files>},
          {"consistent4d", consistent4d, consistent4d_seeds, held<consistent4d_files>}};
}

}  // namespace gflow::fuzz
