#include "apps/stress/stress.hpp"
namespace gflow::stress {
Tests training_tests() { return {}; }
}
