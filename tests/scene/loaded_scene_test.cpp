// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/loaded_scene.hpp"

#include "tests/support/temporary_folder.hpp"

using namespace gflow;

// Messages said "scene scene" of a folder of this name.
TEST(LoadedScene, AFolderMayBeCalledScene) {
  Scene scene;
  scene.name = "scene";
  expect_error([&] { frames_of_split(scene, "val"); }, {"scene 'scene' has no val views"});
  const TemporaryFolder folder;
  const std::string missing = folder.path() + "/scene";
  expect_error([&] { read_scene(missing); },
               {"cannot read " + missing + ": there is no such scene folder or video"});
}
