// SPDX-License-Identifier: Apache-2.0
// Settings: changes by a file and --set, rejected values and their messages, and lossless printing.
#include "optim/options/train_options.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>

#include "optim/options/quality.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

using testing::TempDir;

// A file that is removed with the object.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& text) { std::ofstream(path) << text; }
  ~TemporaryFile() { std::remove(path.c_str()); }
  const std::string path = TempDir() + "gflow_config_test.toml";
};

std::string message_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

std::string message_of_file(const std::string& text) {
  const TemporaryFile file(text);
  TrainOptions config;
  return message_of([&] { apply_file(config, file.path); });
}

std::string message_of_setting(const std::string& assignment) {
  TrainOptions config;
  return message_of([&] { apply_setting(config, assignment); });
}

#define EXPECT_CONTAINS(text, part) EXPECT_NE((text).find(part), std::string::npos) << (text)

TEST(ApplySetting, TakesNumbersAsPeopleWriteThem) {
  TrainOptions config;
  apply_setting(config, "flow.weight=.25");
  EXPECT_EQ(config.flow.weight, 0.25f);
  apply_setting(config, "flow.weight=2.");
  EXPECT_EQ(config.flow.weight, 2.f);
}

TEST(ApplySetting, TakesAListOfNamesAsTextWithCommas) {
  TrainOptions config;
  apply_setting(config, "scene.skip_cameras=[\"cam03\", \"cam13\"]");
  EXPECT_EQ(config.scene.skip_cameras, "cam03,cam13");
}

// As in a file: TOML has no hexadecimal fractions.
TEST(ApplySetting, TakesNoHexadecimalFractions) {
  for (const std::string text : {"0x1p-2", "0x.8", "0X1P3"})
    EXPECT_CONTAINS(message_of_setting("flow.weight=" + text),
                    "flow.weight = " + text + " is not allowed; it must be a decimal number");
  EXPECT_CONTAINS(message_of_file("[flow]\nweight = 0x1p-2\n"), "line 2");
  TrainOptions config;
  apply_setting(config, "flow.weight=0x10");  // TOML allows hexadecimal integers
  EXPECT_EQ(config.flow.weight, 16.f);
}

TEST(Config, ANumberThatNoneCanBeIsNamed) {
  EXPECT_CONTAINS(message_of_file("[flow]\nweight = -1e999\n"),
                  ": the number '1e999' is out of range");
  EXPECT_CONTAINS(message_of_setting("flow.weight=1e999"), "1e999 is not allowed");
}

TEST(ApplySetting, ASettingHasTwoNames) {
  for (const char* text : {"train.=3", ".seed=3", " . =3"})
    EXPECT_CONTAINS(message_of_setting(text), "a setting is written section.key=value");
}

TEST(Config, AFileChangesWhatItNamesAndNothingElse) {
  const TemporaryFile file("[train]\niterations = 77\n[flow]\nweight = 1\ntransport = \"ot\"\n");
  TrainOptions config;
  apply_file(config, file.path);
  EXPECT_EQ(config.train.iterations, 77);
  EXPECT_EQ(config.flow.weight, 1.0f);  // an integer is a number
  EXPECT_EQ(config.flow.transport, Transport::ot);
  EXPECT_EQ(config.train.batch, TrainOptions().train.batch);
}

// toml++ reads a folder as an empty file.
TEST(Config, AFolderOrADeviceIsNoFile) {
  TrainOptions config;
  for (const std::string path : {"/tmp", "/dev/zero"})
    expect_error([&] { apply_file(config, path); }, {path, "it is not a file"});
}

TEST(Config, EveryPresetPassesTheCheck) {
  size_t presets = 0;
  for (const auto& file : std::filesystem::directory_iterator(GFLOW_SOURCE_DIR "/apps/presets")) {
    TrainOptions config;
    apply_file(config, file.path().string());
    EXPECT_NO_THROW(check(config)) << file.path();
    const std::string name = file.path().filename().string();
    if (name.rfind("gaussianflow-", 0) == 0) {  // values that the paper does not state
      EXPECT_GT(config.guidance.views, 1);
    } else if (name != "mcmc.toml") {
      EXPECT_EQ(config.motion.model, choice_of(MotionModelKind::hexplane)) << file.path();
      EXPECT_EQ(config.motion.hexplane.curriculum, 0) << file.path();
    } else {
      EXPECT_EQ(config.density.strategy, DensityKind::mcmc);
    }
    ++presets;
  }
  EXPECT_EQ(presets, 6u);
}

TEST(Config, EveryQualityTrainsLongerThanTheOneBefore) {
  int before = 0;
  for (const char* quality : kQualities) {
    TrainOptions config;
    apply_quality(config, quality);
    EXPECT_NO_THROW(check(config)) << quality;
    EXPECT_GT(config.train.iterations, before) << quality;
    before = config.train.iterations;
  }
  TrainOptions standard;
  apply_quality(standard, "standard");
  EXPECT_EQ(to_toml(standard), to_toml({}));
}

TEST(Config, PrintedInFullAndReadBackItIsTheSame) {
  TrainOptions config;
  config.scene.background = Background::black;
  config.train.seed = 1999999999;  // not representable as float
  config.train.device = "quote \" backslash \\ tab \t";
  config.lr.means_final = 1.1754944e-38f;
  config.lr.sh = 1.0f / 3;
  config.flow.enabled = false;
  config.flow.transport = Transport::translate;
  const TemporaryFile file(to_toml(config));
  TrainOptions copy;
  apply_file(copy, file.path);
  EXPECT_EQ(copy.scene.background, Background::black);
  EXPECT_EQ(copy.train.seed, config.train.seed);
  EXPECT_EQ(copy.train.device, config.train.device);
  EXPECT_EQ(copy.lr.means_final, config.lr.means_final);
  EXPECT_EQ(copy.lr.sh, config.lr.sh);
  EXPECT_EQ(to_toml(copy), to_toml(config));
}

// motion.model is "auto" and the scene chooses nodes, whose numbers a resumed run needs.
TEST(Config, TheFileHasTheNumbersOfAModelThatTheSceneMayChoose) {
  TrainOptions config;
  apply_setting(config, "nodes.count=16");
  EXPECT_NE(to_toml(config).find("\n[nodes]"), std::string::npos);
  const TemporaryFile file(to_toml(config));
  TrainOptions copy;
  apply_file(copy, file.path);
  EXPECT_EQ(copy.motion.own_of(motion_model_of(MotionModelKind::nodes)).whole("count"), 16);
}

TEST(Config, TheDefaultsPassTheirOwnCheck) { EXPECT_NO_THROW(check(TrainOptions())); }

TEST(Config, EveryLineOfTheFileHasAComment) {
  std::istringstream lines(to_toml(TrainOptions()));
  int settings = 0;
  for (std::string line; std::getline(lines, line);) {
    if (line.empty()) continue;
    EXPECT_NE(line.find('#'), std::string::npos) << line;
    settings += line.find(" = ") != std::string::npos;
  }
  EXPECT_GT(settings, 40);
}

TEST(Config, NoSettingIsNamedTwice) {
  // TOML rejects duplicate keys, so parsing the printed text is the check.
  EXPECT_EQ(message_of_file(to_toml(TrainOptions())), "no error");
}

TEST(Config, AnUnknownKeyIsNamedWithTheNearestAndItsLine) {
  const std::string message = message_of_file("[train]\nbatch = 2\niteration = 5\n");
  EXPECT_CONTAINS(message, "gflow_config_test.toml, line 3");
  EXPECT_CONTAINS(message, "'train.iteration'");
  EXPECT_CONTAINS(message, "'train.iterations'");
}

TEST(Config, ARightKeyInAWrongSectionIsFound) {
  EXPECT_CONTAINS(message_of_setting("train.ssim=0.1"), "'loss.ssim'");
  EXPECT_CONTAINS(message_of_setting("densty.enabled=true"), "'density.enabled'");
  EXPECT_CONTAINS(message_of_file("iterations = 5\n"), "'train.iterations'");
  EXPECT_CONTAINS(message_of_file("[trian]\n"), "[train]");
  EXPECT_CONTAINS(message_of_setting("loss.flow=3"), "'flow.weight'");
}

TEST(Config, WhereNoNameIsNearNoneIsGuessed) {
  for (const std::string& message : {message_of_setting("zzz.a=2"), message_of_setting("train.x=1"),
                                     message_of_file("[wxyz]\n")})
    EXPECT_CONTAINS(message, "`gflow settings` lists them");
}

TEST(Config, AWrongTypeIsRefusedWithWhatIsAllowed) {
  EXPECT_CONTAINS(message_of_setting("train.iterations=many"), "train.iterations = many");
  EXPECT_CONTAINS(message_of_setting("train.iterations=many"), "a whole number, at least 1");
  EXPECT_CONTAINS(message_of_setting("train.iterations=2.5"), "a whole number");
  EXPECT_CONTAINS(message_of_setting("train.iterations="), "train.iterations = nothing");
  EXPECT_CONTAINS(message_of_setting("flow.enabled=1"), "true or false");
  EXPECT_CONTAINS(message_of_setting("flow.weight=true"), "a number");
  EXPECT_CONTAINS(message_of_setting("flow.transport=teleport"), "paper, ot, material, translate");
  EXPECT_CONTAINS(message_of_file("[train]\ndevice = 3\n"), "text in quotes");
  EXPECT_CONTAINS(message_of_file("[lr]\nfade = [0.3]\n"), "lr.fade = a list is not allowed");
}

TEST(Config, AValueOutOfRangeIsRefusedWithTheRange) {
  EXPECT_CONTAINS(message_of_setting("train.iterations=0"), "at least 1");
  for (const char* many : {"99999999999", "99999999999999999999", "1e30"})
    EXPECT_CONTAINS(message_of_setting(std::string("train.iterations=") + many),
                    "at most 2147483647");
  for (const char* fps : {"1e-9", "1e-300", "-1", "0.001", "1001", "nan"})
    EXPECT_CONTAINS(message_of_setting(std::string("scene.fps=") + fps), "0, or 0.01 to 1000");
  for (const char* fps : {"0", "0.01", "24", "1000"})
    EXPECT_EQ(message_of_setting(std::string("scene.fps=") + fps), "no error") << fps;
  EXPECT_CONTAINS(message_of_setting("loss.ssim=1.01"), "0 to 1");
  EXPECT_CONTAINS(message_of_setting("scene.radius=0"), "above 0");
  EXPECT_CONTAINS(message_of_setting("scene.resolution=3"), "one of 1, 2, 4, 8");
  EXPECT_CONTAINS(message_of_setting("train.seed=2000000001"), "0 to 2000000000");
  EXPECT_CONTAINS(message_of_setting("adam.eps_means=1e-20"), "at least 1.1e-19");
}

bool is_text(const SettingInWords& setting) { return setting.value.front() == '"'; }
bool is_number(const SettingInWords& setting) {
  return !is_text(setting) && setting.value != "true" && setting.value != "false";
}
// A setting section.key as text of a file.
std::string in_a_file(const std::string& name, const std::string& value) {
  const size_t dot = name.find('.');
  return fmt::format("[{}]\n{} = {}\n", name.substr(0, dot), name.substr(dot + 1), value);
}

TEST(Config, NanAndInfinityAreRefusedEverywhere) {
  size_t numbers = 0;
  for (const SettingInWords& setting : settings_in_words(TrainOptions())) {
    numbers += is_number(setting);
    for (const char* value : {"nan", "-nan", "+nan", "inf", "-inf", "+inf"}) {
      const std::string told = setting.name + " = ";
      EXPECT_CONTAINS(message_of_file(in_a_file(setting.name, value)), told);
      if (is_text(setting)) continue;  // a word without quotes is a text as well
      EXPECT_CONTAINS(message_of_setting(setting.name + "=" + value), told);
    }
    if (!is_number(setting)) continue;
    for (const char* value : {"1e300", "-1e300", "3.41e38", "-3.41e38"})
      EXPECT_CONTAINS(message_of_setting(setting.name + "=" + value), "it must be");
  }
  EXPECT_GE(numbers, 100u) << "those of no kind above were not tried";
}

// Also if a program sets it.
TEST(Config, NanAndInfinityAreFoundInEverySetting) {
  TrainOptions config;
  size_t numbers = 0;
  TrainOptions::sections(config, [&](const char* section, auto& part, const char*) {
    std::decay_t<decltype(part)>::fields(part, [&](const char* key, auto& member, const auto&...) {
      if constexpr (std::is_same_v<std::decay_t<decltype(member)>, float>) {
        const float before = member;
        for (const float value : {std::nanf(""), HUGE_VALF, -HUGE_VALF}) {
          member = value;
          EXPECT_CONTAINS(message_of([&] { check(config); }), fmt::format("{}.{}", section, key));
        }
        member = before;
        ++numbers;
      }
    });
  });
  EXPECT_EQ(message_of([&] { check(config); }), "no error");
  EXPECT_GE(numbers, 50u);
}

// A setting never changes a number silently: it keeps the number in the precision of its type, or
// rejects it with its name and the allowed values.
TEST(Config, ANumberIsKeptOrRefusedByName) {
  for (const SettingInWords& setting : settings_in_words(TrainOptions())) {
    if (!is_number(setting)) continue;
    for (const char* value : {"0", "-0.0", "-1", "1", "0.5", "1e30", "-1e30", "1e-30", "1e-46",
                              "2147483648", "9223372036854775807", "-9223372036854775808"}) {
      TrainOptions config;
      const std::string message =
          message_of([&] { apply_setting(config, fmt::format("{}={}", setting.name, value)); });
      if (message != "no error") {
        EXPECT_CONTAINS(message, fmt::format("{} = ", setting.name));
        EXPECT_CONTAINS(message, "it must be");
        continue;
      }
      const double kept = std::stod(setting_values(config).at(setting.name)),
                   asked = std::stod(value);
      EXPECT_NEAR(kept, asked, std::fabs(asked) * 6e-8 + 1e-45) << setting.name;
      EXPECT_EQ(message_of([&] { check(config); }), "no error") << setting.name << " = " << value;
      TrainOptions again;
      apply_text(again, to_toml(config), "printed");
      EXPECT_EQ(to_toml(again), to_toml(config));
    }
  }
}

TEST(Config, BoundsThatNoDoubleHoldsAreStillAllowed) {
  TrainOptions config;
  apply_setting(config, "init.opacity=0.99");
  EXPECT_NO_THROW(check(config));
}

TEST(Config, SettingsNeedNoQuotes) {
  TrainOptions config;
  apply_setting(config, "flow.transport=paper");
  apply_setting(config, "flow.source = \"files\"");
  apply_setting(config, "flow.folder=some folder/flow");
  apply_setting(config, "train.device=0");
  EXPECT_EQ(config.flow.transport, Transport::paper);
  EXPECT_EQ(config.flow.source, FlowSource::files);
  EXPECT_EQ(config.flow.folder, "some folder/flow");
  EXPECT_EQ(config.train.device, "0");
}

TEST(Config, FormerNamesStillWorkAndAreNoted) {
  TrainOptions options;
  testing::internal::CaptureStderr();
  apply_setting(options, "flow.reach=8");
  apply_text(options, "[motion]\nrest = 0.5\nrest_every = 7\n", "old.toml");
  apply_setting(options, "flow.reach=4");
  const std::string notices = testing::internal::GetCapturedStderr();
  EXPECT_EQ(options.flow.span, 4);
  EXPECT_EQ(options.motion.static_threshold, 0.5f);
  EXPECT_EQ(options.motion.static_every, 7);
  EXPECT_CONTAINS(notices, "flow.reach was renamed to flow.span");
  EXPECT_CONTAINS(notices, "motion.rest was renamed to motion.static_threshold");
  EXPECT_EQ(notices.find("flow.reach"), notices.rfind("flow.reach"));  // once
}

TEST(Config, AnAssignmentWithoutSectionOrValueIsExplained) {
  EXPECT_CONTAINS(message_of_setting("iterations=5"), "section.key=value");
  EXPECT_CONTAINS(message_of_setting("train.iterations"), "section.key=value");
  EXPECT_CONTAINS(message_of_setting("train.iterations=5\nseed=2"), "more than one setting");
}

TEST(Config, AFileThatIsNotTomlIsNamedWithItsLine) {
  const std::string message = message_of_file("[train]\niterations = = 3\n");
  EXPECT_CONTAINS(message, "gflow_config_test.toml, line 2, column ");
  EXPECT_CONTAINS(message, ": the value is missing or malformed; text needs quotes");
  EXPECT_CONTAINS(message_of([] {
                    TrainOptions config;
                    apply_file(config, "no/such/file.toml");
                  }),
                  "no/such/file.toml");
}

TEST(Config, AFileThatIsNotTomlIsExplainedInOurWords) {
  const std::vector<std::pair<std::string, std::string>> problems = {
      {"[motion]\nmodel = hexplane\n", "text needs quotes"},
      {"[init]\nfrom = file\n", "text needs quotes"},
      {"[train]\niterations = 12x\n", "text needs quotes"},
      {"[train]\nseed = 1\nseed = 2\n", ": this name is already used above"},
      {"train = [\n", "a bracket or quote is not closed"},
      {"[train]\ndevice = \"abc\n", "a quote is not closed in its line"},
      {"iterations\n", "there is no '=' after the name"},
      {"# \xff\n", "the text is not UTF-8"},
      {"[train\n", "this is not valid TOML"}};
  for (const auto& [text, words] : problems) {
    const std::string message = message_of_file(text);
    EXPECT_CONTAINS(message, words);
    EXPECT_CONTAINS(message, "gflow_config_test.toml, line ");
    EXPECT_EQ(message.find("Error while"), std::string::npos) << message;
  }
}

TEST(Config, WhatIsRefusedIsShownInOneShortLine) {
  const std::string rubbish = "two\\nlines \\u001b[31m " + std::string(65536, 'x');
  for (const std::string& text :
       {"[train]\n\"" + rubbish + "\" = 1\n", "[\"" + rubbish + "\"]\n",
        "[motion]\nmodel = \"" + rubbish + "\"\n", "[train]\niterations = \"" + rubbish + "\"\n"}) {
    const std::string message = message_of_file(text);
    EXPECT_CONTAINS(message, "two");
    EXPECT_LT(message.size(), 400u) << message.substr(0, 400);
    EXPECT_EQ(message.find_first_of("\n\x1b"), std::string::npos) << message.substr(0, 400);
  }
  EXPECT_LT(message_of_setting("motion.model=" + std::string(65536, 'x')).size(), 400u);
}

// A path may be invalid UTF-8, but TOML must be valid.
TEST(Config, EveryPathIsReadAgain) {
  for (const char* path : {"caf\xc3\xa9 \xe7\x94\xbb \xf0\x9f\x8e\xac \xed\x9f\xbf", "plain"}) {
    TrainOptions config;
    config.scene.path = path;
    EXPECT_EQ(to_toml(config).find("file://"), std::string::npos);
  }
  for (const char* path :
       {"caf\xc3\xa9 \xe7\x94\xbb \xf0\x9f\x8e\xac \xed\x9f\xbf", "plain", "file://x%20y",
        "/a b/%41\xff\"\\\n", "caf\xe9", "\xc0\xaf", "\xe0\x80\xaf", "\xed\xa0\x80",
        "\xf4\x90\x80\x80", "\xff", "\x80", "cut \xe7\x94"}) {
    TrainOptions config, read;
    config.scene.path = path;
    config.train.seed = 7;
    apply_text(read, to_toml(config), "a test");
    EXPECT_EQ(read.scene.path, path);
    EXPECT_EQ(read.train.seed, 7);
  }
  TrainOptions config;
  apply_setting(config, "scene.path=file:///a%20b/caf%E9");
  EXPECT_EQ(config.scene.path, "/a b/caf\xe9");
  for (const char* address : {"file:///%", "file:///%4", "file:///%4g", "file:///a%00b"})
    EXPECT_CONTAINS(message_of_setting(std::string("scene.path=") + address), "file:// URL");
}

}  // namespace
}  // namespace gflow
