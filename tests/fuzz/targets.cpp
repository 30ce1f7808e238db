// SPDX-License-Identifier: Apache-2.0
#include "fuzz/targets.hpp"

#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "data_readers/made_scene.hpp"
#include "fuzz/zip_checksums.hpp"
#include "optim/data/cameras_json.hpp"
#include "optim/data/colmap_model.hpp"
#include "optim/data/given_cameras.hpp"
#include "optim/data/image_header.hpp"
#include "optim/data/movie.hpp"
#include "optim/data/packed_flow.hpp"
#include "optim/data/point_tracks.hpp"
#include "optim/data/readers.hpp"
#include "optim/data/video.hpp"
#include "optim/io/compressed_ply.hpp"
#include "optim/io/dot_splat.hpp"
#include "optim/io/flo.hpp"
#include "optim/io/four_dgs.hpp"
#include "optim/io/npz.hpp"
#include "optim/io/splat_table.hpp"
#include "optim/io/spz.hpp"
#include "optim/train/checkpoint.hpp"
#include "optim/train/config.hpp"
#include "train/random_model.hpp"

namespace gflow::fuzz {
namespace {

namespace fs = std::filesystem;

// A folder in memory, for as long as the process lives.
const std::string& folder() {
  static const struct Folder {
    std::string path = fmt::format("/dev/shm/gflow-fuzz-{}", ::getpid());
    Folder() { fs::create_directories(path); }
    ~Folder() { fs::remove_all(path); }
  } folder;
  return folder.path;
}

void write(const std::string& name, const void* bytes, size_t size) {
  const fs::path path = folder() + "/" + name;
  fs::create_directories(path.parent_path());
  std::ofstream(path, std::ios::binary).write(static_cast<const char*>(bytes), long(size));
}
void write(const std::string& name, const std::string& text) {
  write(name, text.data(), text.size());
}

template <class Read>
void may_refuse(Read&& read) {
  try {
    read();
  } catch (const Error&) {
  }
}

// The bytes as a file of that name.
template <class Read>
void as_file(const uint8_t* bytes, size_t size, const std::string& name, Read&& read) {
  write(name, bytes, size);
  may_refuse([&] { read(folder() + "/" + name); });
}
template <class Read>
void as_zip(const uint8_t* bytes, size_t size, const std::string& name, Read&& read) {
  write(name, with_checksums(bytes, size));
  may_refuse([&] { read(folder() + "/" + name); });
}

struct File {
  std::string name, text;
};

// A scene of these files but for one, which the first byte chooses: that is the rest of the bytes.
template <class Read>
void in_scene(const uint8_t* bytes, size_t size, const std::string& scene,
              const std::vector<File>& files, Read&& read) {
  if (size == 0) return;
  const size_t other = bytes[0] % files.size();
  for (size_t i = 0; i < files.size(); ++i)
    if (i != other)
      write(scene + "/" + files[i].name, files[i].text);
    else
      write(scene + "/" + files[i].name, bytes + 1, size - 1);
  may_refuse([&] { read(folder() + "/" + scene); });
}

void seed(const std::string& folder, const std::string& name, const std::string& bytes) {
  std::ofstream(folder + "/" + name, std::ios::binary) << bytes;
}
void seeds_of(const std::string& folder, const std::vector<File>& files) {
  for (size_t i = 0; i < files.size(); ++i)
    seed(folder, std::to_string(i), std::string(1, char(i)) + files[i].text);
}
void copy_seed(const std::string& folder, const std::string& path, size_t most = 1 << 18) {
  if (fs::exists(path) && fs::file_size(path) <= most)
    fs::copy_file(path, folder + "/" + fs::path(path).filename().string(),
                  fs::copy_options::overwrite_existing);
}
void copy_seeds(const std::string& folder, const std::string& from) {
  if (!fs::exists(from)) return;
  for (const auto& entry : fs::recursive_directory_iterator(from))
    if (entry.is_regular_file()) copy_seed(folder, entry.path().string());
}

std::string capture(const std::string& name) {
  return contents(std::string(GFLOW_SOURCE_DIR) + "/tests/data/captures/" + name);
}

// A picture of this size as the bytes of a PNG.
std::string png(int width, int height, int channels = 3) {
  const std::string name = folder() + "/made.png";
  write_png(name, pattern(width, height, channels));
  return contents(name);
}

PlyTable small_table(int sh_degree) {
  SplatTable table(3, sh_degree);
  for (size_t i = 0; i < 3; ++i) {
    const SplatRow row = table.row(i);
    row.mean[0] = float(i), row.quat[0] = 1, row.log_scales[1] = -1;
  }
  return table.table;
}

std::string written(const std::string& name, const std::function<void(const std::string&)>& write) {
  write(folder() + "/" + name);
  return contents(folder() + "/" + name);
}

// --- one file -----------------------------------------------------------------------------------

void ply(const uint8_t* bytes, size_t size) {
  as_file(bytes, size, "a.ply", [](const std::string& path) { read_ply(path); });
  may_refuse([] { read_ply_elements(folder() + "/a.ply"); });
  may_refuse([] { read_point_cloud(folder() + "/a.ply"); });
}
void ply_seeds(const std::string& to) {
  seed(to, "table", written("s.ply", [](const std::string& p) { write_ply(p, small_table(1)); }));
  seed(to, "points", written("p.ply", [](const std::string& p) {
         write_point_cloud(p, {{1, 2, 3, 4, 5, 6}, {1, 2, 3, 4, 5, 6}});
       }));
  seed(to, "text",
       "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n"
       "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
       "end_header\n1 2 3 4 5 6\n7 8 9 10 11 12\n");
  copy_seeds(to, shared("data/splat_models/splat_transform_fixtures"));
}

void compressed_ply(const uint8_t* bytes, size_t size) {
  as_file(bytes, size, "a.compressed.ply",
          [](const std::string& path) { read_compressed_ply(path); });
}
void compressed_ply_seeds(const std::string& to) {
  copy_seeds(to, shared("data/splat_models/splat_transform_fixtures"));
}

void dot_splat(const uint8_t* bytes, size_t size) {
  as_file(bytes, size, "a.splat", [](const std::string& path) { read_dot_splat(path); });
}
void dot_splat_seeds(const std::string& to) {
  seed(to, "a",
       written("s.splat", [](const std::string& p) { write_dot_splat(p, small_table(0)); }));
}

void spz(const uint8_t* bytes, size_t size) {
  as_file(bytes, size, "a.spz", [](const std::string& path) { read_spz(path); });
}
void spz_seeds(const std::string& to) {
  copy_seeds(to, shared("data/splat_models/splat_transform_fixtures"));
}

void four_dgs(const uint8_t* bytes, size_t size) {
  as_file(bytes, size, "a.4dgs", [](const std::string& path) {
    const MovingSplats scene = read_four_dgs(path);
    splats_at(scene, scene.duration / 2);
  });
}
void four_dgs_seeds(const std::string& to) {
  for (const char* name : {"one_gaussian", "two_windows", "chunk_ends_first"})
    copy_seed(to, fmt::format("{}/tests/data/four_dgs/{}.4dgs", GFLOW_SOURCE_DIR, name));
}

void npy(const uint8_t* bytes, size_t size) {
  as_file(bytes, size, "a.npy", [](const std::string& path) { read_npy(path); });
}
void npy_seeds(const std::string& to) {
  seed(to, "a", written("s.npy", [](const std::string& p) {
         write_npy(p, {{2, 3}, std::vector<float>(6, 1.f)});
       }));
}

void npz(const uint8_t* bytes, size_t size) {
  as_zip(bytes, size, "a.npz", [](const std::string& path) { read_npz(path); });
}
void npz_seeds(const std::string& to) {
  for (const Packing packing : {Packing::deflated, Packing::stored})
    seed(to, packing == Packing::stored ? "stored" : "deflated",
         written("s.npz", [&](const std::string& p) {
           write_npz(
               p, {{"a", {{2}, std::vector<double>{1, 2}}}, {"b", {{}, std::vector<int32_t>{1}}}},
               packing);
         }));
}

void point_tracks(const uint8_t* bytes, size_t size) {
  as_zip(bytes, size, "t.npz", [](const std::string& path) {
    const PointTracks tracks = read_point_tracks(path);
    flow_of_points(tracks, 0, tracks.pictures - 1, 8, 6);
  });
}
void point_tracks_seeds(const std::string& to) {
  seed(to, "a", written("s.npz", [](const std::string& p) {
         write_npz(p,
                   {{"tracks", {{2, 2, 2}, std::vector<float>{1, 2, 3, 4, 2, 2, 4, 4}}},
                    {"visibility", {{2, 2}, std::vector<uint8_t>{1, 1, 0, 1}}}},
                   Packing::stored);
       }));
}

void flo(const uint8_t* bytes, size_t size) {
  as_file(bytes, size, "a.flo", [](const std::string& path) { read_flo(path); });
}
void flo_seeds(const std::string& to) {
  seed(to, "a", written("s.flo", [](const std::string& p) {
         FlowField flow;
         flow.width = 3, flow.height = 2, flow.uv.resize(12), flow.valid.assign(6, 1);
         write_flo(p, flow);
       }));
  const Bytes zipped = gzip(contents(to + "/a"));
  seed(to, "gz", std::string(zipped.begin(), zipped.end()));
}

void kitti_flow(const uint8_t* bytes, size_t size) {
  as_file(bytes, size, "a.png", [](const std::string& path) { read_kitti_flow(path); });
}
void kitti_flow_seeds(const std::string& to) { seed(to, "a", png(4, 3)); }

void picture(const uint8_t* bytes, size_t size) {
  as_file(bytes, size, "a.png", [](const std::string& path) {
    const ImageHeader header = read_image_header(path);
    if (size_t(header.width) * size_t(header.height) < 1 << 20) read_image(path);
  });
}
void picture_seeds(const std::string& to) {
  seed(to, "rgb", png(5, 4));
  seed(to, "rgba", png(5, 4, 4));
  const std::string jpg = folder() + "/made.jpg";
  write_png(jpg, pattern(8, 8));  // by its ending a JPEG
  seed(to, "jpg", contents(jpg));
}

// As a video is read: what it says, when its frames are shown, the first of them.
void video(const uint8_t* bytes, size_t size) {
  as_file(bytes, size, "a.mp4", [](const std::string& path) {
    const VideoInfo info = video_info(path);
    const std::vector<double> times = frame_times(path, 4);
    if (size_t(info.width) * size_t(info.height) > 1 << 20) return;
    Video open(path);
    for (int k = 0; k < int(times.size()); ++k) open.frame(k);
  });
}
void video_seeds(const std::string& to) {
  seed(to, "mp4", written("s.mp4", [](const std::string& path) {
         write_movie(
             path, 3, [](size_t) { return pattern(32, 24); }, 10);
       }));
}

void packed_flow(const uint8_t* bytes, size_t size) {
  may_refuse([&] { unpacked(Bytes(bytes, bytes + size), "the input"); });
}
void packed_flow_seeds(const std::string& to) {
  TeacherFlow teacher;
  teacher.flow.width = 4, teacher.flow.height = 3;
  for (int i = 0; i < 12; ++i) {
    teacher.flow.uv.push_back(float(i) / 4), teacher.flow.uv.push_back(-1);
    teacher.flow.valid.push_back(1), teacher.confidence.push_back(uint8_t(20 * i));
  }
  const Bytes bytes = packed(teacher);
  seed(to, "a", std::string(bytes.begin(), bytes.end()));
}

void config(const uint8_t* bytes, size_t size) {
  may_refuse([&] {
    TrainConfig config;
    apply_text(config, std::string(bytes, bytes + size), "the input");
    check(config);
  });
}
void config_seeds(const std::string& to) { seed(to, "a", to_toml(TrainConfig())); }

// A model of each motion, and what it keeps in a second file: the first byte chooses.
constexpr size_t kMotions = 5;
const std::vector<File>& model_files(size_t motion) {
  static const std::vector<std::vector<File>> all = [] {
    std::vector<std::vector<File>> files;
    for (size_t k = 0; k < kMotions; ++k) {
      const std::string path = folder() + "/made.ply";
      fs::remove(tables_path(path));
      write_model(path, random_model(2, 1, MotionModelKind(k)));
      files.push_back({{"m.ply", contents(path)}});
      if (fs::exists(tables_path(path)))
        files.back().push_back({"m.motion.npz", contents(tables_path(path))});
    }
    return files;
  }();
  return all[motion % kMotions];
}
void model(const uint8_t* bytes, size_t size) {
  if (size == 0) return;
  const std::vector<File>& files = model_files(bytes[0] / 2);
  fs::remove(folder() + "/model/m.motion.npz");
  std::string input(reinterpret_cast<const char*>(bytes), size);
  if (bytes[0] % files.size() == 1) input = input[0] + with_checksums(bytes + 1, size - 1);
  in_scene(reinterpret_cast<const uint8_t*>(input.data()), input.size(), "model", files,
           [](const std::string& path) { read_model(path + "/m.ply"); });
}
void model_seeds(const std::string& to) {
  for (size_t k = 0; k < kMotions; ++k)
    for (size_t file = 0; file < model_files(k).size(); ++file)
      seed(to, fmt::format("{}_{}", k, file),
           std::string(1, char(2 * k + file)) + model_files(k)[file].text);
}

void checkpoint(const uint8_t* bytes, size_t size) {
  as_zip(bytes, size, "c.npz", [](const std::string& path) { read_checkpoint(path); });
  may_refuse([] { read_checkpoint_facts(folder() + "/c.npz"); });
}
void checkpoint_seeds(const std::string& to) {
  Checkpoint some;
  some.facts.config = to_toml(TrainConfig());
  some.arrays["a"] = {{2}, std::vector<float>{1, 2}};
  seed(to, "a", written("s.npz", [&](const std::string& p) { write_checkpoint(p, some); }));
}

void cameras_json(const uint8_t* bytes, size_t size) {
  as_file(bytes, size, "cameras.json", [](const std::string& path) { read_cameras_json(path, 1); });
}
void cameras_json_seeds(const std::string& to) {
  seed(to, "a",
       R"([{"id": 0, "img_name": "a", "width": 8, "height": 6, "position": [0, 0, 1],
            "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "fx": 10, "fy": 11}])");
}

// As `--cameras FILE` of a plain video.
void given_cameras(const uint8_t* bytes, size_t size) {
  as_file(bytes, size, "transforms.json", [](const std::string& path) {
    SceneOptions options;
    options.cameras = path;
    for (const size_t pictures : {1, 3}) cameras_of_view(options, pictures, 54, 96, "v.mp4");
  });
}
void given_cameras_seeds(const std::string& to) {
  cameras_json_seeds(to);
  seed(to, "nerfstudio", capture("nerfstudio/transforms.json"));
}

// --- scenes of several files --------------------------------------------------------------------

std::vector<File> colmap_text_files() {
  return {{"cameras.txt", capture("colmap/sparse/0/cameras.txt")},
          {"images.txt", capture("colmap/sparse/0/images.txt")},
          {"points3D.txt", capture("colmap/sparse/0/points3D.txt")}};
}
void colmap_text(const uint8_t* bytes, size_t size) {
  in_scene(bytes, size, "colmap_text", colmap_text_files(),
           [](const std::string& path) { read_colmap_model(path); });
}
void colmap_text_seeds(const std::string& to) { seeds_of(to, colmap_text_files()); }

template <class T>
std::string raw(T value) {
  return {reinterpret_cast<const char*>(&value), sizeof value};
}
std::vector<File> colmap_binary_files() {
  std::string cameras =
      raw(uint64_t(1)) + raw(uint32_t(7)) + raw(int32_t(4)) + raw(uint64_t(8)) + raw(uint64_t(6));
  for (const double p : {10., 10., 4., 3., -.1, .02, .003, .004}) cameras += raw(p);
  std::string images = raw(uint64_t(1)) + raw(uint32_t(2));
  for (const double p : {1., 0., 0., 0., 0., 0., 5.}) images += raw(p);
  images += raw(uint32_t(7)) + std::string("b.png") + '\0' + raw(uint64_t(1)) + raw(1.5) +
            raw(2.5) + raw(uint64_t(1));
  const std::string points = raw(uint64_t(1)) + raw(uint64_t(1)) + raw(0.5) + raw(-1.0) + raw(2.0) +
                             "\x0a\x14\x1e" + raw(0.1) + raw(uint64_t(1)) + raw(uint32_t(2)) +
                             raw(uint32_t(0));
  return {{"cameras.bin", cameras}, {"images.bin", images}, {"points3D.bin", points}};
}
void colmap_binary(const uint8_t* bytes, size_t size) {
  in_scene(bytes, size, "colmap_binary", colmap_binary_files(),
           [](const std::string& path) { read_colmap_model(path); });
}
void colmap_binary_seeds(const std::string& to) { seeds_of(to, colmap_binary_files()); }

const std::vector<File>& nerfies_files() {
  static const std::vector<File> files{
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

const std::vector<File>& panoptic_files() {
  static const std::vector<File> files = [] {
    std::vector<File> all{{"train_meta.json", capture("panoptic/train_meta.json")}};
    for (const int camera : {1, 3, 5, 8})
      for (const int t : {0, 1})
        all.push_back({fmt::format("ims/{}/{:06}.jpg", camera, t), png(64, 36)});
    return all;
  }();
  return files;
}
void panoptic(const uint8_t* bytes, size_t size) {
  in_scene(bytes, size, "panoptic", panoptic_files(),
           [](const std::string& path) { read_panoptic(path, {}); });
}
void panoptic_seeds(const std::string& to) { seeds_of(to, panoptic_files()); }

const std::vector<File>& nerfstudio_files() {
  static const std::vector<File> files{{"transforms.json", capture("nerfstudio/transforms.json")},
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

const std::vector<File>& blender_files() {
  static const std::string frames =
      R"({"camera_angle_x": 0.7, "frames": [{"file_path": "./train/r_000", "time": 0.0,
          "transform_matrix": [[1,0,0,0],[0,1,0,2],[0,0,1,3],[0,0,0,1]]}]})";
  static const std::vector<File> files{{"transforms_train.json", frames},
                                       {"transforms_test.json", frames},
                                       {"train/r_000.png", png(8, 6, 4)}};
  return files;
}
void blender(const uint8_t* bytes, size_t size) {
  in_scene(bytes, size, "blender", blender_files(),
           [](const std::string& path) { read_blender(path, {}); });
}
void blender_seeds(const std::string& to) { seeds_of(to, blender_files()); }

const std::vector<File>& n3v_files() {
  static const std::vector<File> files = [] {
    std::vector<double> poses;
    for (int camera = 0; camera < 2; ++camera)
      for (const double p :
           {1., 0., 0., double(camera), 6., 0., 1., 0., 0., 8., 0., 0., 1., 3., 10., 0.1, 20.})
        poses.push_back(p);
    std::vector<File> all{{"poses_bounds.npy", written("s.npy", [&](const std::string& p) {
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
void n3v_seeds(const std::string& to) { seeds_of(to, n3v_files()); }

}  // namespace

const std::vector<Target>& targets() {
  static const std::vector<Target> all{{"ply", ply, ply_seeds},
                                       {"compressed_ply", compressed_ply, compressed_ply_seeds},
                                       {"dot_splat", dot_splat, dot_splat_seeds},
                                       {"spz", spz, spz_seeds},
                                       {"four_dgs", four_dgs, four_dgs_seeds},
                                       {"npy", npy, npy_seeds},
                                       {"npz", npz, npz_seeds},
                                       {"point_tracks", point_tracks, point_tracks_seeds},
                                       {"flo", flo, flo_seeds},
                                       {"kitti_flow", kitti_flow, kitti_flow_seeds},
                                       {"picture", picture, picture_seeds},
                                       {"video", video, video_seeds},
                                       {"packed_flow", packed_flow, packed_flow_seeds},
                                       {"config", config, config_seeds},
                                       {"model", model, model_seeds},
                                       {"checkpoint", checkpoint, checkpoint_seeds},
                                       {"cameras_json", cameras_json, cameras_json_seeds},
                                       {"given_cameras", given_cameras, given_cameras_seeds},
                                       {"colmap_text", colmap_text, colmap_text_seeds},
                                       {"colmap_binary", colmap_binary, colmap_binary_seeds},
                                       {"nerfies", nerfies, nerfies_seeds},
                                       {"panoptic", panoptic, panoptic_seeds},
                                       {"nerfstudio", nerfstudio, nerfstudio_seeds},
                                       {"blender", blender, blender_seeds},
                                       {"n3v", n3v, n3v_seeds}};
  return all;
}

}  // namespace gflow::fuzz
