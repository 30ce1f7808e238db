// SPDX-License-Identifier: Apache-2.0
// `gflow import`: converts any splat file to a standard 3DGS PLY.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>

#include "apps/common/command_line.hpp"
#include "apps/common/options.hpp"
#include "apps/common/output_path.hpp"
#include "optim/formats/four_dgs.hpp"
#include "optim/formats/ply_comments.hpp"
#include "optim/formats/splat_table.hpp"
#include "runtime/base/lower.hpp"
#include "runtime/base/option.hpp"
#include "runtime/base/output.hpp"

namespace gflow {
namespace {

struct ImportFlags {
  std::string input, output, format = "auto";
  std::optional<double> time;  // [s]
  Undrawable undrawable = Undrawable::left_out;
};

SplatFormat format_wanted(const ImportFlags& flags) {
  if (flags.format == "auto") return splat_format(flags.input);
  const auto names = names_of(SplatFormat{});
  return SplatFormat(std::find(names.begin(), names.end(), flags.format) - names.begin());
}

// A file of moving Gaussians at one time; default: half of its duration.
PlyTable moment_of(const ImportFlags& flags) {
  const MovingSplats scene = read_four_dgs(flags.input);
  const double time = flags.time.value_or(scene.duration / 2);
  if (!(time == 0 || (time > 0 && time < scene.duration)))  // a static file may last 0 s
    throw Error(
        fmt::format("--time {} is outside {}; it must be at least 0 s and less than {:.6g} s", time,
                    flags.input, scene.duration));
  return splats_at(scene, time);
}

void run_import(const ImportFlags& flags) {
  const std::string ending = lower(std::filesystem::path(flags.output).extension().string());
  if (ending != ".ply")
    throw Error(
        fmt::format("importing to {}: the output is a PLY; end its name in .ply", flags.output));
  require_other_file(flags.output, flags.input);
  require_no_file_of_run(flags.output);
  const SplatFormat format = format_wanted(flags);
  if (flags.time && format != SplatFormat::four_dgs)
    throw Error(
        fmt::format("--time is only for .4dgs files; {} is {}", flags.input, name_of(format)));
  PlyTable table = format == SplatFormat::four_dgs
                       ? moment_of(flags)
                       : read_splats(flags.input, format, flags.undrawable);
  table.origin = origin_of(table, flags.input);
  if (table.column("scale_t") >= 0)
    throw Error(
        fmt::format("importing {}: it is a dynamic model; `gflow export --format ply "
                    "--times T` writes a PLY of one time",
                    flags.input));
  const StandardRows standard(table, flags.input);
  if (table.rows == 0)
    throw Error(fmt::format("importing {}: it contains no Gaussians", flags.input));
  const auto copy_finite = [&](size_t i, float* values) {
    standard.copy(i, values);
    for (size_t c = 0; c < standard.head().names.size(); ++c)
      if (!std::isfinite(values[c]))
        throw Error(fmt::format(
            "importing {}: Gaussian {} has a non-finite value ({}), which viewers cannot render",
            flags.input, i, standard.head().names[c]));
  };
  write_ply(flags.output, standard.head(), copy_finite);
  print_result("read      {}, {}\nwritten   {}, {} Gaussians\n", flags.input, name_of(format),
               flags.output, table.rows);
}

}  // namespace

void add_import(CLI::App& app, const GlobalOptions&) {
  auto flags = std::make_shared<ImportFlags>();
  CLI::App* command =
      app.add_subcommand("import", "Convert a splat file of another program to a standard PLY");
  command
      ->add_option("FILE", flags->input,
                   "3DGS PLY, compressed PLY (SuperSplat), .splat, .spz or .4dgs")
      ->check(path_given())
      ->required()
      ->type_name("PATH");
  command->add_option("-o,--output", flags->output, "Output PLY; an existing file is replaced")
      ->check(path_given())
      ->required()
      ->type_name("FILE.ply");
  std::vector<std::string> formats{"auto"};
  for (const char* name : names_of(SplatFormat{})) formats.push_back(name);
  command
      ->add_option("--format", flags->format,
                   "Format of FILE: auto (by its first bytes, .splat by its name), ply, "
                   "compressed-ply, splat, spz or 4dgs")
      ->check(choice_of(formats));
  command->add_option("--time", flags->time, "4dgs: time to import, in seconds; default: half-way")
      ->check(number_in(0, 1e15))
      ->type_name("SECONDS");
  add_strict(*command, flags->undrawable);
  command->callback([flags] { run_import(*flags); });
}

}  // namespace gflow
