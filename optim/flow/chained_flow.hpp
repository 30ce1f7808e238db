// SPDX-License-Identifier: Apache-2.0
// Flow over several pictures of a track, put together from the flows between neighbours. Over 2, 4
// and 8 pictures DIS that is chained is off by .31, .54, .98 px on n3v-sphere (lower quartile over
// tracks that pass the check), computed in one leap by .30, 3.6, 12 px; on n3v-baton .58, 1.2, 3.1
// and .89, 21, 94; on c4d-fox, which hardly turns, .24, .34, .59 and .24, .23, .43.
#pragma once
#include <memory>
#include <vector>

#include "optim/flow/estimated_flow.hpp"
#include "optim/flow/flow_store.hpp"

namespace gflow {

using Links = std::vector<std::shared_ptr<const TeacherFlow>>;

// Follows each pixel through the links, one after the other, of one size. Between pixels a link is
// the bilinear mean of those of the four around that move as the nearest does: a mean across a
// silhouette is the motion of nothing. Valid and of confidence 255 where every link on the way is
// trusted at the pixel nearest to the path; what is hidden on the way, if only for a moment, ends.
TeacherFlow chained(const Links& links);

// The same, trusted only where the links `back`, from the last picture to the first, lead back to
// where the path began, by the rule of consistency().
TeacherFlow chained(const Links& there, const Links& back);

// Loaders of pairs[links->size()] and those after it, which lead over several of the pairs before
// them, the neighbours that `links` is a store of: chained, and checked against the way back where
// `links` has it. Where a link is missing there is no chain. keep: where checked chains are kept;
// may be empty. Others are made anew when they are asked for: a name must not stand for both.
std::vector<FlowStore::Loader> chained_flows(std::shared_ptr<FlowStore> links,
                                             const std::vector<FlowPair>& pairs,
                                             const KeepFlow& keep = {});

}  // namespace gflow
