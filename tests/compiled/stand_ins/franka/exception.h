// Stand-in for libfranka's exceptions.
#pragma once

#include <stdexcept>

namespace franka {

struct Exception : std::runtime_error {
  using std::runtime_error::runtime_error;
};
struct NetworkException : Exception {
  using Exception::Exception;
};
struct ControlException : Exception {
  using Exception::Exception;
};

}  // namespace franka
