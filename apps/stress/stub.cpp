#include "apps/stress/stress.hpp"
namespace gflow::stress {
Tests compositing_tests() { return {}; }
Tests replay_tests() { return {}; }
Tests loss_tests() { return {}; }
Tests projection_tests() { return {}; }
Tests parameter_tests() { return {}; }
Tests poison_tests() { return {}; }
Tests degenerate_tests() { return {}; }
Tests optimiser_tests() { return {}; }
Tests gradient_tests() { return {}; }
Tests device_tests() { return {}; }
std::vector<Derivative> derivatives(Queue&) { return {}; }
}
