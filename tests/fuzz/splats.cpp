// SPDX-License-Identifier: Apache-2.0
// Gaussians at one time and all times, as other programs write them.
#include "fuzz/inputs.hpp"
#include "optim/io/compressed_ply.hpp"
#include "optim/io/dot_splat.hpp"
#include "optim/io/four_dgs.hpp"
#include "optim/io/splat_table.hpp"
#include "optim/io/spz.hpp"

namespace gflow::fuzz {
namespace {

PlyTable small_table(int sh_degree) {
  SplatTable table(3, sh_degree);
  for (size_t i = 0; i < 3; ++i) {
    const SplatRow row = table.row(i);
    row.mean[0] = float(i), row.quat[0] = 1, row.log_scales[1] = -1;
  }
  return table.table;
}

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

}  // namespace

std::vector<Target> splat_targets() {
  return {{"ply", ply, ply_seeds},
          {"compressed_ply", compressed_ply, compressed_ply_seeds},
          {"dot_splat", dot_splat, dot_splat_seeds},
          {"spz", spz, spz_seeds},
          {"four_dgs", four_dgs, four_dgs_seeds}};
}

}  // namespace gflow::fuzz
