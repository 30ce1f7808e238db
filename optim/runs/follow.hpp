// SPDX-License-Identifier: Apache-2.0
// Training on several devices (optim/train/seat.hpp): how the leader, which runs train_run(),
// starts the others, and what these do.
#pragma once
#include "optim/runs/resume.hpp"

namespace gflow {

// Error if the views of a batch cannot be divided over so many devices, or a setting needs one.
void require_divisible(const TrainOptions& config, size_t devices);

// The leader, before its first step: tells the others settings and state, and joins them with its
// trainer. Error that names the device if one has another version of gflow, another scene or a
// different device. Waits.
void lead(Seat& seat, Queue& queue, const Scene& scene, Checkpointer& checkpoints, int step,
          Trainer& trainer);
// Any other device: trains what the leader trains until that ends, and keeps nothing. What it needs
// of the scene it reads and computes itself. Errors reach the leader. Never throws.
void follow(Seat& seat, Queue& queue) noexcept;

}  // namespace gflow
