// SPDX-License-Identifier: Apache-2.0
// Flow across several frames of a track, chained from the flows between neighbours. Where objects
// rotate, chaining is several px more accurate than DIS in one leap of 4 or 8 frames; where they
// hardly rotate, it is slightly worse.
#pragma once
#include <memory>
#include <vector>

#include "optim/flow/estimated_flow.hpp"
#include "optim/flow/flow_store.hpp"

namespace gflow {

using Links = std::vector<std::shared_ptr<const TargetFlow>>;

// Follows each pixel through the links, which have one size. Between pixels a link is interpolated
// only from those of the four neighbours that move like the nearest one, because averaging across a
// silhouette gives a motion of no surface. Valid, with confidence 255, where every link is trusted
// at the pixel nearest to the path; a path ends where its point is occluded.
TargetFlow chained(const Links& links);

// The same. Confidence is 255 only if the links `back`, from the last frame to the first, return to
// the start of the path, by the rule of consistency().
TargetFlow chained(const Links& there, const Links& back);

// Loaders of pairs[links->size()] and later ones. They span several frames and are chained from
// `links`, the flows of the pairs before them, and checked against the reverse chain if `links` has
// it. There is no flow if a link is missing. Checked chains are stored by `keep` if it is not
// empty; unchecked chains are recomputed on each request, so that a stored name always means a
// checked one.
std::vector<FlowStore::Loader> chained_flows(std::shared_ptr<FlowStore> links,
                                             const std::vector<FlowPair>& pairs,
                                             const StoreFlow& keep = {});

}  // namespace gflow
