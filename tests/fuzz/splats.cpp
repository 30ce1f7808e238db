// SPDX-License-Identifier: Apache-2.0
// Static and moving Gaussians in the formats of other programs.
#include <zlib.h>

#include "optim/formats/compressed_ply.hpp"
#include "optim/formats/dot_splat.hpp"
#include "optim/formats/four_dgs.hpp"
#include "optim/formats/splat_table.hpp"
#include "optim/formats/spz.hpp"
#include "runtime/files/atomic_file.hpp"
#include "tests/fuzz/inputs.hpp"

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
  may_refuse([] { read_splats(folder() + "/a.ply"); });
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
  seed(to, "big_endian",
       "ply\nformat binary_big_endian 1.0\nelement face 1\nproperty list uchar short ids\n"
       "element vertex 2\nproperty float x\nproperty double y\nproperty int z\nend_header\n" +
           std::string("\2\0\1\0\2", 5) + std::string(2 * 16, '\1'));
  real_seed(to, "splat_models/kacytran_iter7000.ply");
}

void compressed_ply(const uint8_t* bytes, size_t size) {
  as_file(bytes, size, "a.compressed.ply",
          [](const std::string& path) { read_compressed_ply(path); });
}
void compressed_ply_seeds(const std::string& to) {
  std::string made = "ply\nformat binary_little_endian 1.0\nelement chunk 1\n";
  for (const char* of : {"", "scale_"})
    for (const char* end : {"min_", "max_"})
      for (const char axis : {'x', 'y', 'z'})
        made += fmt::format("property float {}{}{}\n", end, of, axis);
  made += "element vertex 2\n";
  for (const char* name : {"position", "rotation", "scale", "color"})
    made += fmt::format("property uint packed_{}\n", name);
  made += "element sh 2\n";
  for (int k = 0; k < 9; ++k) made += fmt::format("property uchar f_rest_{}\n", k);
  made += "end_header\n" + std::string(12 * 4 + 2 * 16 + 2 * 9, '\1');
  seed(to, "made", made);
  real_seed(to, "splat_models/guitar.compressed.ply");
}

void dot_splat(const uint8_t* bytes, size_t size) {
  as_file(bytes, size, "a.splat", [](const std::string& path) { read_dot_splat(path); });
}
void dot_splat_seeds(const std::string& to) {
  seed(to, "a",
       written("s.splat", [](const std::string& p) { write_dot_splat(p, small_table(0)); }));
  real_seed(to, "splat_models/splat_transform_fixtures/minimal.splat");
}

std::string gunzipped(const std::string& path) {
  std::string text(65536, '\0');
  const gzFile file = gzopen(path.c_str(), "rb");
  text.resize(size_t(std::max(0, gzread(file, text.data(), unsigned(text.size())))));
  gzclose(file);
  return text;
}

// Packed here, because zlib rejects almost all damaged packed files.
void spz(const uint8_t* bytes, size_t size) {
  const Bytes packed = gzip({reinterpret_cast<const char*>(bytes), size});
  as_file(packed.data(), packed.size(), "a.spz", [](const std::string& path) { read_spz(path); });
}
void spz_seeds(const std::string& to) {
  for (const int version : {2, 3})
    for (const int degree : {0, 3}) {
      const size_t each =
          size_t(version == 2 ? 19 : 20) + 3 * size_t((degree + 1) * (degree + 1) - 1);
      seed(to, fmt::format("version_{}_degree_{}", version, degree),
           "NGSP" + std::string{char(version), 0, 0, 0, 2, 0, 0, 0, char(degree), 12, 0, 0} +
               std::string(2 * each, '\1'));
    }
  for (const char* name : {"minimal-v2.spz", "minimal-v3.spz"})
    real_seed(to, std::string("splat_models/splat_transform_fixtures/") + name, "", gunzipped);
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
  MovingSplats equal;  // a stream with one value for all
  equal.duration = 1;
  equal.splats.resize(20000);
  for (MovingSplat& splat : equal.splats) splat.scales = {1, 1, 1};
  write_four_dgs(to + "/equal.4dgs", equal);
}

}  // namespace

std::vector<Target> splat_targets() {
  return {{"ply", ply, ply_seeds, its_size},
          {"compressed_ply", compressed_ply, compressed_ply_seeds, its_size},
          {"dot_splat", dot_splat, dot_splat_seeds, its_size},
          {"spz", spz, spz_seeds, packed_file},
          {"four_dgs", four_dgs, four_dgs_seeds, packed_file}};
}

}  // namespace gflow::fuzz
