#include "apps/stress/stress.hpp"
namespace gflow::stress {
std::vector<Derivative> derivatives(Queue&) { return {}; }
}
