// SPDX-License-Identifier: Apache-2.0
// `gflow splat`: runs the engine on the arrays of an .npz file, for scripts.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <memory>

#include "apps/common/command_line.hpp"
#include "apps/common/options.hpp"
#include "apps/common/output_path.hpp"
#include "optim/engine/splat_file.hpp"
#include "runtime/base/warning.hpp"

namespace gflow {
namespace {

template <class Enum>
std::vector<std::string> words_of(Enum any) {
  const auto names = names_of(any);
  return {names.begin(), names.end()};
}

// Throws an Error for a cotangent with an unknown name: it would silently produce no gradients.
// Other arrays are allowed, such as the expected values of an oracle.
void require_known_cotangents(const std::string& path) {
  for (const std::string& name : names_in_npz(path))
    if (name.rfind("v_", 0) == 0 && !splat_arrays_known.count(name))
      throw Error(
          fmt::format("reading {}: array '{}' is not a known cotangent; known are v_rgb, v_alpha, "
                      "v_depth and v_flow",
                      path, name));
}

}  // namespace

void add_splat(CLI::App& app, const GlobalOptions& options) {
  struct Flags {
    std::string input, output, transport = "paper", stop = "include";
    int lanes = 0;
    SplatOptions splat;
  };
  auto flags = std::make_shared<Flags>();
  CLI::App* command = app.add_subcommand(
      "splat", "Render Gaussians of an .npz file: images, flow, and gradients for each v_* in it");
  command
      ->add_option("IN", flags->input,
                   "means quats scales opacities colors, viewmat K size [background], and for "
                   "flow means_t2 quats_t2 scales_t2 [viewmat_t2]; cotangents v_rgb v_alpha "
                   "v_depth v_flow")
      ->check(path_given())
      ->required()
      ->type_name("FILE.npz");
  command
      ->add_option("-o,--output", flags->output,
                   "Output .npz: rgb alpha depth flow, g_* for each v_*, and broken, the indices "
                   "of Gaussians with non-finite values")
      ->check(path_given())
      ->required()
      ->type_name("FILE.npz");
  command
      ->add_option("--transport", flags->transport,
                   "How a pixel moves with a Gaussian: paper, ot, material or translate")
      ->check(choice_of(words_of(Transport{})));
  command
      ->add_option("--stop", flags->stop,
                   "Whether the splat that saturates a pixel is drawn: include or exclude")
      ->check(choice_of(words_of(StopRule{})));
  command
      ->add_option("--top-k", flags->splat.settings.top_k,
                   "Gaussians per pixel that contribute to flow, in depth order; 0: all")
      ->check(number_in(0, 1000000));
  command->add_flag("--detach-t1", flags->splat.settings.detach_t1,
                    "No flow gradient to the geometry at t1");
  command
      ->add_option("--near", flags->splat.near_plane,
                   "Skip Gaussians closer to the camera [scene units]")
      ->check(number_in(0, 1e9));
  command
      ->add_option("--lanes", flags->lanes,
                   "Pixels per work-item: 16, 8, 4, or 1 as on GPUs; 0: chosen for the device")
      ->check(choice_of({"0", "1", "4", "8", "16"}));
  command->callback([flags, &options] {
    flags->splat.settings.transport = value_named<Transport>(flags->transport);
    flags->splat.settings.stop = value_named<StopRule>(flags->stop);
    require_other_file(flags->output, flags->input);
    require_writable("-o", flags->output);
    require_known_cotangents(flags->input);
    const Arrays input = read_npz(flags->input, splat_arrays_known);
    QueueOptions queue_options;
    queue_options.lanes = flags->lanes;
    Queue queue = open_queue(options, queue_options);
    const Arrays output = splat_arrays(queue, input, flags->splat, flags->input);
    const std::vector<int> broken = output.at("broken").as_int();
    if (!broken.empty())
      warn(
          fmt::format("{} of the Gaussians in {} have non-finite values and are not rendered, or "
                      "have no flow; the first has index {}, 'broken' lists all",
                      broken.size(), flags->input, broken[0]));
    for (const auto& [key, array] : output) {
      const std::vector<float> values = array.as_float();
      const auto lost = std::count_if(values.begin(), values.end(),
                                      [](float value) { return !std::isfinite(value); });
      if (lost > 0)
        warn(fmt::format(
            "{} of the {} values of '{}' are NaN or Inf: values in {} are too large for float",
            lost, values.size(), key, flags->input));
    }
    write_npz(flags->output, output);
  });
}

}  // namespace gflow
