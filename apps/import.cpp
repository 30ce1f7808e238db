// SPDX-License-Identifier: Apache-2.0
// `gflow import`: any splat file as a standard 3DGS PLY.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>

#include "apps/command_line.hpp"
#include "apps/options.hpp"
#include "optim/io/splat_table.hpp"

namespace gflow {
namespace {

struct ImportFlags {
  std::string input, output, format = "auto";
};

SplatFormat format_wanted(const ImportFlags& flags) {
  if (flags.format == "auto") return splat_format(flags.input);
  const auto names = names_of(SplatFormat{});
  return SplatFormat(std::find(names.begin(), names.end(), flags.format) - names.begin());
}

void run_import(const ImportFlags& flags) {
  const SplatFormat format = format_wanted(flags);
  const PlyTable table = read_splats(flags.input, format);
  if (table.column("scale_t") >= 0)
    throw Error(
        fmt::format("{} is a moving model of gflow; `gflow export --format ply --times T` "
                    "makes a PLY of one of its times",
                    flags.input));
  const SplatTable standard = standard_table(table, flags.input);
  write_ply(flags.output, standard.table);
  fmt::print("read      {}, {}\nwritten   {}, {} Gaussians\n", flags.input,
             names_of(format)[size_t(format)], flags.output, standard.table.rows);
}

}  // namespace

void add_import(CLI::App& app, const GlobalOptions&) {
  auto flags = std::make_shared<ImportFlags>();
  CLI::App* command =
      app.add_subcommand("import", "Turn a splat file of another program into a standard PLY");
  command->add_option("FILE", flags->input, "3DGS PLY, compressed PLY (SuperSplat), .splat or .spz")
      ->required()
      ->type_name("PATH");
  command->add_option("-o,--output", flags->output, "PLY that is written")
      ->required()
      ->type_name("FILE.ply");
  std::vector<std::string> formats{"auto"};
  for (const char* name : names_of(SplatFormat{})) formats.push_back(name);
  command
      ->add_option("--format", flags->format,
                   "What FILE is: auto (by its first bytes, .splat by its name), ply, "
                   "compressed-ply, splat or spz")
      ->check(choice_of(formats));
  command->callback([flags] { run_import(*flags); });
}

}  // namespace gflow
