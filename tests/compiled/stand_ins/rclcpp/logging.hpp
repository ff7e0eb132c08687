// Stand-in for rclcpp's logging.
#pragma once

#include <cstdio>

namespace rclcpp {
struct Logger {};
}  // namespace rclcpp

#define RCLCPP_ERROR(logger, ...) \
  do {                            \
    (void)(logger);               \
    std::printf(__VA_ARGS__);     \
    std::printf("\n");            \
  } while (false)
