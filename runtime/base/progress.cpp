// SPDX-License-Identifier: Apache-2.0
// See progress.hpp. The terminal's width is queried for every drawing, since windows change size.
#include "runtime/base/progress.hpp"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>

#include "runtime/base/printable.hpp"
#include "runtime/base/terminal.hpp"

namespace gflow {
namespace {

constexpr size_t bar_cells = 24;
constexpr size_t plain_width = 200;  // of lines written to a file

size_t terminal_width() {
  winsize size = {};
  const bool known = ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0;
  return known ? size.ws_col - 1 : 79;  // a full last column would wrap
}

std::string speed_text(double per_second) {
  if (!std::isfinite(per_second)) return "- it/s";
  if (per_second >= 100) return fmt::format("{:.0f} it/s", per_second);
  if (per_second >= 1) return fmt::format("{:.1f} it/s", per_second);
  return fmt::format("{:.2f} it/s", per_second);
}

std::string bar_text(long done, long total) {
  const double share = total > 0 ? std::clamp(double(done) / double(total), 0.0, 1.0) : 1.0;
  const auto filled = static_cast<size_t>(share * double(bar_cells));
  return "[" + std::string(filled, '#') + std::string(bar_cells - filled, '-') + "]";
}

}  // namespace

std::string duration_text(double seconds) {
  if (!(seconds >= 0) || seconds > 1e9) return "-:--";
  const long whole = std::lround(seconds);
  if (whole < 3600) return fmt::format("{}:{:02}", whole / 60, whole % 60);
  return fmt::format("{}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60);
}

std::string progress_line(const ProgressState& state, double seconds, size_t width) {
  const auto& [label, first, done, total, terms] = state;
  const double per_second = seconds > 0 && done > first ? double(done - first) / seconds : NAN;
  const std::string time = done >= total
                               ? "in " + duration_text(seconds)
                               : "ETA " + duration_text(double(total - done) / per_second);
  const std::string counts =
      fmt::format("  {}/{}  {}  {}", done, total, speed_text(per_second), time);
  // the most informative one that fits into the window
  const std::string choices[] = {label + "  " + bar_text(done, total) + counts, label + counts,
                                 fmt::format("{}/{}  {}", done, total, time),
                                 fmt::format("{}/{}", done, total),
                                 fmt::format("{}%", total > 0 ? 100 * done / total : 100)};
  const auto fits = [&](const std::string& text) { return text.size() <= width; };
  const auto* chosen = std::find_if(std::begin(choices), std::end(choices), fits);
  if (chosen == std::end(choices)) return "";
  std::string line = *chosen;
  for (const ProgressTerm& term : terms) {
    const std::string text = "  " + term.name + (term.name.empty() ? "" : " ") + term.value;
    if (line.size() + text.size() > width) break;
    line += text;
  }
  return line;
}

Progress::Progress(std::string label, long total, bool quiet, long first)
    : state_{std::move(label), first, first, total, {}},
      quiet_(quiet),
      terminal_(redraws_lines()),
      start_(Clock::now()),
      drawn_(start_) {}

Progress::~Progress() {
  if (!finished_ && terminal_ && !quiet_) std::fputc('\n', stderr);
}

void Progress::update(long done, std::vector<ProgressTerm> terms) {
  const std::lock_guard<std::mutex> lock(mutex_);
  state_.done = done;
  state_.terms = std::move(terms);
  draw_if_due();
}

void Progress::advance() {
  const std::lock_guard<std::mutex> lock(mutex_);
  ++state_.done;
  draw_if_due();
}

void Progress::print_line(const std::string& sentence) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const bool drawn = terminal_ && !quiet_;  // a line that is being redrawn must be erased first
  std::fputs(((drawn ? "\r\x1b[K" : "") + printable(sentence) + "\n").c_str(), stderr);
}

void Progress::finish() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (finished_) return;
  finished_ = true;
  if (!quiet_) draw(true);
}

void Progress::draw_if_due() {
  const auto now = Clock::now();
  // In a file each drawing is a line, so they become rarer: about a hundred in the first hour.
  const auto pause = terminal_
                         ? Clock::duration(std::chrono::milliseconds(100))
                         : std::max<Clock::duration>(std::chrono::seconds(5), (now - start_) / 20);
  if (quiet_ || now - drawn_ < pause) return;
  drawn_ = now;
  draw(false);
}

void Progress::draw(bool last) {
  const double seconds = std::chrono::duration<double>(Clock::now() - start_).count();
  const size_t width = terminal_ ? terminal_width() : plain_width;
  const std::string line = progress_line(state_, seconds, width);
  // \r and "erase to the end of the line": the previous text may have been longer.
  if (terminal_)
    std::fputs(("\r" + line + "\x1b[K" + (last ? "\n" : "")).c_str(), stderr);
  else
    std::fputs((line + "\n").c_str(), stderr);
  std::fflush(stderr);
}

}  // namespace gflow
