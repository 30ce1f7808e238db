// SPDX-License-Identifier: Apache-2.0
// Single files: arrays, flow, images, video and cameras.
#include "optim/flow/packed_flow.hpp"
#include "optim/flow/point_tracks.hpp"
#include "optim/formats/flo.hpp"
#include "optim/formats/npz.hpp"
#include "optim/images/image_header.hpp"
#include "optim/images/movie.hpp"
#include "optim/images/video.hpp"
#include "optim/scene/cameras_json.hpp"
#include "optim/scene/readers/given_cameras.hpp"
#include "optim/scene/readers/readers.hpp"
#include "tests/fuzz/inputs.hpp"
#include "tests/support/png_writer.hpp"

namespace gflow::fuzz {
namespace {

void npy(const uint8_t* bytes, size_t size) {
  as_file(bytes, size, "a.npy", [](const std::string& path) { read_npy(path); });
}
void npy_seeds(const std::string& to) {
  seed(to, "a", written("s.npy", [](const std::string& p) {
         write_npy(p, {{2, 3}, std::vector<float>(6, 1.f)});
       }));
  real_seed(to, "dynerf_flame_steak_5v/poses_bounds.npy");
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
    flow_of_points(tracks, 0, tracks.frames - 1, 8, 6);
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

std::string small_flo() {
  return written("s.flo", [](const std::string& path) {
    FlowField flow;
    flow.width = 3, flow.height = 2, flow.uv.resize(12), flow.valid.assign(6, 1);
    write_flo(path, flow);
  });
}
bool is_gzip(const uint8_t* bytes, size_t size) {
  return size > 1 && bytes[0] == 0x1f && bytes[1] == 0x8b;
}
void flo(const uint8_t* bytes, size_t size) {
  as_file(bytes, size, "a.flo", [](const std::string& path) { read_flo(path); });
}
Holds held_by_flo(const uint8_t* bytes, size_t size) {  // by its first bytes
  return is_gzip(bytes, size) ? Holds::packed : Holds::its_size;
}
void flo_seeds(const std::string& to) {
  seed(to, "a", small_flo());
  real_seed(to, "flow_middlebury_rubberwhale/flow_gt.flo");
}

// Reads the bytes packed, because zlib rejects almost all damaged packed files, and as they are.
void flo_gz(const uint8_t* bytes, size_t size) {
  const Bytes packed = gzip({reinterpret_cast<const char*>(bytes), size});
  as_file(packed.data(), packed.size(), "a.flo.gz", [](const std::string& p) { read_flo(p); });
  as_file(bytes, size, "b.flo.gz", [](const std::string& path) { read_flo(path); });
}
void flo_gz_seeds(const std::string& to) {
  flo_seeds(to);
  const Bytes zipped = gzip(small_flo());
  seed(to, "gz", std::string(zipped.begin(), zipped.end()));
}

void kitti_flow(const uint8_t* bytes, size_t size) {
  as_png(bytes, size, "a.png", [](const std::string& path) { read_kitti_flow(path); });
}
void kitti_flow_seeds(const std::string& to) {
  seed(to, "a", png(4, 3));
  real_seed(to, "flow_kitti/flow_gt.png");
}

void image(const uint8_t* bytes, size_t size) {
  as_png(bytes, size, "a.png", [](const std::string& path) {
    const ImageHeader header = read_image_header(path);
    if (size_t(header.width) * size_t(header.height) < 1 << 20) read_image(path);
  });
}
void image_seeds(const std::string& to) {
  seed(to, "rgb", png(5, 4));
  seed(to, "rgba", png(5, 4, 4));
  const std::string jpg = folder() + "/made.jpg";
  write_png(jpg, pattern(8, 8));  // a JPEG by its extension
  seed(to, "jpg", contents(jpg));
  for (const auto& entry : fs::directory_iterator(GFLOW_SOURCE_DIR "/tests/data/pictures"))
    seed(to, entry.path().filename().string(), contents(entry.path().string()));
  std::mt19937 rng(9);
  for (const PngKind& kind : {PngKind{3, 4, false, true},
                              {2, 16, true, true},
                              {0, 1, false, true},
                              {4, 16, false, false}})
    seed(to, fmt::format("png_{}_{}", kind.colour, kind.depth),
         png_of(kind, random_rows(kind, rng)));
  real_seed(to, "consistent4d_trex/0.png");
}

// Reads a video as gflow does: its information, its frame times, its first frame.
void video(const uint8_t* bytes, size_t size) {
  as_file(bytes, size, "a.mp4", [](const std::string& path) {
    const VideoInfo info = video_info(path);
    const std::vector<double> times = frame_times(path, 4);
    if (size_t(info.width) * size_t(info.height) > 1 << 20) return;
    Video open(path);
    for (int k = 0; k < int(times.size()); ++k) open.frame(k);
    read_video_file(path, {});
  });
}
void video_seeds(const std::string& to) {
  seed(to, "mp4", written("s.mp4", [](const std::string& path) {
         write_movie(
             path, 3, [](size_t) { return pattern(32, 24); }, 10);
       }));
  real_seed(to, "videos_opencv/tree.avi");
}

void packed_flow(const uint8_t* bytes, size_t size) {
  may_refuse([&] { unpacked(Bytes(bytes, bytes + size), "the input"); });
}
void packed_flow_seeds(const std::string& to) {
  TargetFlow target_flow;
  target_flow.flow.width = 4, target_flow.flow.height = 3;
  for (int i = 0; i < 12; ++i) {
    target_flow.flow.uv.push_back(float(i) / 4), target_flow.flow.uv.push_back(-1);
    target_flow.flow.valid.push_back(1), target_flow.confidence.push_back(uint8_t(20 * i));
  }
  const Bytes bytes = packed(target_flow);
  seed(to, "a", std::string(bytes.begin(), bytes.end()));
}

void cameras_json(const uint8_t* bytes, size_t size) {
  as_file(bytes, size, "cameras.json", [](const std::string& path) { read_cameras_json(path, 1); });
}
void cameras_json_seeds(const std::string& to) {
  seed(to, "a",
       R"([{"id": 0, "img_name": "a", "width": 8, "height": 6, "position": [0, 0, 1],
            "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "fx": 10, "fy": 11}])");
}

// Cameras of a plain video, as by `--cameras FILE`.
void given_cameras(const uint8_t* bytes, size_t size) {
  as_file(bytes, size, "transforms.json", [](const std::string& path) {
    SceneOptions options;
    options.cameras = path;
    std::vector<std::string> notices;
    for (const size_t images : {1, 3})
      cameras_of_view(options, {images, {}, true, 54, 96, "v.mp4"}, notices);
  });
}
void given_cameras_seeds(const std::string& to) {
  cameras_json_seeds(to);
  seed(to, "nerfstudio", capture("nerfstudio/transforms.json"));
}

}  // namespace

std::vector<Target> file_targets() {
  return {{"npy", npy, npy_seeds, its_size},
          {"npz", npz, npz_seeds, packed_file},
          {"point_tracks", point_tracks, point_tracks_seeds, packed_file},
          {"flo", flo, flo_seeds, held_by_flo},
          {"flo_gz", flo_gz, flo_gz_seeds, packed_file},
          {"kitti_flow", kitti_flow, kitti_flow_seeds, packed_file},
          {"image", image, image_seeds, packed_file},
          {"video", video, video_seeds, any_video},
          {"packed_flow", packed_flow, packed_flow_seeds, packed_file},
          {"cameras_json", cameras_json, cameras_json_seeds, its_size},
          {"given_cameras", given_cameras, given_cameras_seeds, its_size}};
}

}  // namespace gflow::fuzz
