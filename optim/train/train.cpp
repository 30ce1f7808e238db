// SPDX-License-Identifier: Apache-2.0
#include "optim/train/train.hpp"

#include "optim/train/guidance_provider.hpp"
#include "optim/train/preparation.hpp"
#include "runtime/files/temporary_folder.hpp"

namespace gflow {

TrainResult train(Queue& queue, Scene scene, const TrainOptions& options,
                  const TrainExtensions& extensions) {
  check(options);
  TrainObserver silent;
  TrainObserver& observer = extensions.observer ? *extensions.observer : silent;
  const std::unique_ptr<WarningsTo> warnings = warnings_to(extensions.observer);
  const ScratchFolder folder("train");
  Preparation prepared(options,
                       with_frames(std::move(scene), options.scene, folder.file("frames")));
  const std::unique_ptr<Guidance> guidance = guidance_of(options);
  prepared.find_motion_masks();
  prepared.compute_flow(folder.file("flow"), true,
                        [&](size_t done, size_t pairs) { observer.on_flow(done, pairs); });
  Model model(queue, prepared.first_model(queue));
  Trainer trainer = prepared.trainer(queue, model, guidance.get(), extensions.objectives);
  TrainResult result;
  result.steps = train_loop(queue, trainer, 0, options.train.iterations, observer);
  prepared.flows().prefetch({});  // cancel: no further flow is needed
  if (result.steps > 0) result.report = trainer.report(queue);
  result.model = model.read(queue);
  result.cameras = prepared.frames().moved_cameras();
  return result;
}

}  // namespace gflow
