// Stand-in for the one constant that is used.
#pragma once

namespace franka {
constexpr double kMaxCutoffFrequency = 1000.0;
}
