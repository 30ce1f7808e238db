// SPDX-License-Identifier: Apache-2.0
#include "apps/report/html.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <cmath>
#include <ctime>

#include "apps/report/report_files.hpp"
#include "runtime/base/printable.hpp"

namespace gflow::report {
namespace {

std::string cell_html(const TableCell& cell, const char* element, const char* more) {
  return fmt::format("<{0}{1}{2}>{3}{4}{5}</{0}>", element, more,
                     cell.is_text ? " class=\"text\"" : "", cell.strong ? "<b>" : "", cell.html,
                     cell.strong ? "</b>" : "");
}

}  // namespace

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : printable_lines(text)) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string number(double value, int digits) {
  return std::isfinite(value) ? fmt::format("{:.{}f}", value, digits) : "–";
}

std::string grouped(double value) {
  std::string text = number(value, 0);
  for (size_t end = text.size(); std::isfinite(value) && end > 3; end -= 3)
    if (text[end - 4] != '-') text.insert(end - 3, "\u202f");
  return text;
}

std::string duration(double seconds) {
  if (!std::isfinite(seconds)) return "–";
  if (seconds < 90) return fmt::format("{:.0f} s", seconds);
  if (seconds < 90 * 60) return fmt::format("{:.1f} min", seconds / 60);
  return fmt::format("{:.1f} h", seconds / 3600);
}

std::string counted(size_t count, std::string_view one, std::string_view several) {
  return fmt::format("{} {}", grouped(double(count)), count == 1 ? one : several);
}

std::string today() {
  const std::time_t now = std::time(nullptr);
  return fmt::format("{:%Y-%m-%d}", fmt::gmtime(now));
}

std::string table(const std::string& caption, const std::vector<TableCell>& head,
                  const std::vector<std::vector<TableCell>>& rows) {
  std::string text = fmt::format(
      "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"{0}\"><table>"
      "<caption>{0}</caption>\n<thead><tr>",
      caption);
  for (const TableCell& cell : head) text += cell_html(cell, "th", " scope=\"col\"");
  text += "</tr></thead>\n<tbody>\n";
  for (const std::vector<TableCell>& row : rows) {
    text += "<tr>";
    for (size_t i = 0; i < row.size(); ++i)
      text += cell_html(row[i], i == 0 ? "th" : "td", i == 0 ? " scope=\"row\"" : "");
    text += "</tr>\n";
  }
  return text + "</tbody></table></div>\n";
}

std::string brand(const std::string& what, const std::string& date) {
  return fmt::format(
      "<div class=\"brand\"><svg viewBox=\"0 0 16 16\" aria-hidden=\"true\"><ellipse cx=\"8\" "
      "cy=\"8\" rx=\"7.5\" ry=\"3.6\" transform=\"rotate(-30 8 8)\"/></svg>gflow, {0}<time "
      "datetime=\"{1}\">{1}</time></div>\n",
      escaped(what), escaped(date));
}

std::string section(const std::string& heading, const std::string& about, const std::string& body) {
  return fmt::format("<section>\n<h2>{}</h2>\n{}{}</section>\n", heading,
                     about.empty() ? "" : fmt::format("<p class=\"about\">{}</p>\n", about), body);
}

std::string page(const std::string& title, const std::string& contents) {
  return fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<meta name=\"generator\" content=\"gflow\">\n<title>{}</title>\n<style>\n{}</style>\n"
      "</head>\n<body>\n<main>\n{}</main>\n<script>\n{}</script>\n</body>\n</html>\n",
      escaped(title), report_files().at("report.css"), contents, report_files().at("wipe.js"));
}

}  // namespace gflow::report
