// SPDX-License-Identifier: Apache-2.0
#include "apps/viewer/html.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <zlib.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <regex>
#include <set>
#include <sstream>
#include <vector>

#include "runtime/base/base64.hpp"
#include "runtime/base/error.hpp"
#include "runtime/files/json_text.hpp"

namespace gflow {
namespace {

constexpr const char* kWorker = "sort.worker.js";
constexpr const char* kCharset = "<meta charset=\"utf-8\">";

// Says that a page is truncated: at its beginning, because its end does not run then.
constexpr const char* kCheck = R"(<script>
addEventListener('DOMContentLoaded', () => {
if (document.getElementById('gflow-end')) return;
const say = (id, text) => { const one = document.getElementById(id) ?? document.body; one.textContent = text; one.hidden = !text; };
say('busy', '');
say('message', 'This file is truncated: its end is missing. Copy or export it again.');
});
</script>
)";

// Unpacks the scripts of a page and starts them; gflow-worker is what the page starts as its
// worker. gzip has a checksum, which the browser compares.
constexpr const char* kStart = R"(try {
const packed = Uint8Array.from(atob(document.getElementById('gflow-scripts').textContent), (c) => c.charCodeAt(0));
const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream('gzip'));
const scripts = await new Response(stream).json();
for (const [type, text, id] of [['text/plain', scripts.worker, 'gflow-worker'], ['module', scripts.page, '']])
document.body.append(Object.assign(document.createElement('script'), { type, id, textContent: text }));
} catch {
const message = document.getElementById('message');
message.textContent = typeof DecompressionStream === 'undefined'
? 'This browser is too old to unpack the scene (DecompressionStream is missing). A newer version can.'
: 'This file is damaged: its scripts cannot be unpacked. Copy or export it again.';
message.hidden = false;
document.getElementById('busy').hidden = true;
}
)";

// A module without the words import and export.
struct Module {
  std::vector<std::pair<std::string, std::string>> imports;  // names, file
  std::vector<std::string> exports;
  std::string body;
};

Module parsed(const std::string& text, const std::string& file) {
  static const std::regex import_line(
      R"(import\s*\{\s*([\w$]+(?:\s*,\s*[\w$]+)*)\s*,?\s*\}\s*from\s*['"]\./([\w.-]+)['"];?\s*)");
  static const std::regex export_line(
      R"(export\s+((?:async\s+)?function\s*\*?|const|class)\s+([\w$]+)(.*))");
  Module module;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line); module.body += '\n') {
    std::smatch found;
    if (line.rfind("import", 0) == 0)  // it may have several lines
      for (std::string more; line.find(';') == std::string::npos && std::getline(lines, more);)
        line += more;
    if (line.rfind("import", 0) == 0 && std::regex_match(line, found, import_line)) {
      module.imports.emplace_back(found[1], found[2]);
    } else if (line.rfind("export", 0) == 0 && std::regex_match(line, found, export_line)) {
      module.exports.push_back(found[2]);
      module.body += line.substr(line.find(found[1]));
    } else if (line.rfind("import", 0) == 0 || line.rfind("export", 0) == 0) {
      throw Error(fmt::format("{} cannot be put into one file: {}", file, line));
    } else {
      module.body += line;
    }
  }
  return module;
}

// Without indentation and lines that are comments: a fifth of the text.
std::string slim(const std::string& text) {
  std::string result;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    line.erase(0, std::min(line.find_first_not_of(' '), line.size()));
    if (!line.empty() && line.rfind("//", 0) != 0) result += line + '\n';
  }
  return result;
}

// "$" and the file's name as a name of the language.
std::string variable_of(const std::string& file) {
  std::string name = "$" + file;
  for (char& c : name)
    if (c == '.' || c == '-') c = '_';
  return name;
}

struct Bundle {
  const std::map<std::string, std::string>& files;
  std::set<std::string> begun, done;
  std::string text;

  void add(const std::string& file, bool entry) {
    if (done.count(file)) return;
    const auto found = files.find(file);
    if (found == files.end()) throw Error(fmt::format("the viewer's page lacks {}", file));
    if (!begun.insert(file).second)
      throw Error(fmt::format("the viewer's {} imports itself", file));
    const Module module = parsed(found->second, file);
    std::string names;
    for (const auto& [list, other] : module.imports) {
      add(other, false);
      names += fmt::format("const {{ {} }} = {};\n", list, variable_of(other));
    }
    if (entry)
      text += names + module.body;
    else
      text += fmt::format("const {} = (() => {{\n{}{}return {{ {} }};\n}})();\n", variable_of(file),
                          names, module.body, fmt::join(module.exports, ", "));
    done.insert(file);
  }
};

// Text inside of <script> or <style>, which ends where these words are.
std::string inside_element(const std::string& text) {
  for (const char* end : {"</script", "</style", "<!--"})
    if (text.find(end) != std::string::npos)
      throw Error(
          fmt::format("the viewer's page cannot be put into one file: it contains {}", end));
  return text;
}

std::string packed_element(const std::string& id, const std::string& bytes) {
  return fmt::format(
      "<script type=\"application/octet-stream\" id=\"{}\" data-encoding=\"gzip\">{}"
      "</script>\n",
      id, base64(gzipped(bytes)));
}

void replace_first(std::string& page, const std::string& from, const std::string& to) {
  page.replace(page.find(from), from.size(), to);
}

}  // namespace

std::string bundled(const std::map<std::string, std::string>& files, const std::string& entry) {
  Bundle bundle{files, {}, {}, {}};
  bundle.add(entry, true);
  return bundle.text;
}

std::string gzipped(const std::string& bytes) {
  z_stream stream{};
  if (deflateInit2(&stream, 9, Z_DEFLATED, MAX_WBITS + 16, 9, Z_DEFAULT_STRATEGY) != Z_OK)
    throw Error("cannot compress a model: zlib failed to initialise");
  const std::unique_ptr<z_stream, int (*)(z_stream*)> guard(&stream, deflateEnd);
  std::string result;
  std::vector<char> piece(size_t{1} << 20);
  size_t taken = 0;
  int status = Z_OK;
  while (status == Z_OK) {
    const size_t next = std::min(bytes.size() - taken, size_t{1} << 30);  // its counts have 32 bits
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data() + taken));
    stream.avail_in = uInt(next);
    stream.next_out = reinterpret_cast<Bytef*>(piece.data());
    stream.avail_out = uInt(piece.size());
    status = deflate(&stream, taken + next == bytes.size() ? Z_FINISH : Z_NO_FLUSH);
    taken += next - stream.avail_in;
    result.append(piece.data(), piece.size() - stream.avail_out);
  }
  if (status != Z_STREAM_END) throw Error("cannot compress a model: zlib failed");
  return result;
}

std::string page_with_model(const std::map<std::string, std::string>& files,
                            const std::string& model, const nlohmann::ordered_json& info) {
  static const std::regex style_line(R"~(<link rel="stylesheet" href="/?viewer/([\w.-]+)">)~"),
      entry_line(R"~(<script type="module" src="/?viewer/([\w.-]+)"></script>)~");
  std::string page = slim(files.at("index.html"));
  std::smatch found;
  if (!std::regex_search(page, found, style_line))
    throw Error("the viewer's index.html names no style");
  const std::string style = found[0], css = found[1];
  if (!std::regex_search(page, found, entry_line))
    throw Error("the viewer's index.html names no module");
  const std::string script = found[0], entry = found[1];
  const auto script_of = [&](const std::string& file) { return slim(bundled(files, file)); };
  const nlohmann::ordered_json scripts{{"worker", files.count(kWorker) ? script_of(kWorker) : ""},
                                       {"page", script_of(entry)}};
  const std::string parts =
      packed_element("gflow-info", json_text(info)) + packed_element("gflow-model", model) +
      packed_element("gflow-scripts", json_text(scripts)) + "<script type=\"module\">\n" +
      inside_element(kStart) + "</script>\n<i id=\"gflow-end\"></i>";
  replace_first(page, kCharset, kCharset + std::string("\n") + kCheck);
  replace_first(page, style, "<style>\n" + inside_element(slim(files.at(css))) + "</style>");
  replace_first(page, script, parts);
  return page;
}

}  // namespace gflow
