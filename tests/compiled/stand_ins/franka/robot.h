// Stand-in for what examples/libfranka uses of libfranka 0.15: the same names and types. Its robot
// is a file, in which the velocities are written that it follows, a line each cycle. One with
// "lossy:" before it loses three cycles after its first second, and keeps its acceleration meanwhile;
// one whose name has "blocked" in it does not move, whatever is commanded.
#pragma once

#include <array>
#include <cstdint>
#include <fstream>
#include <functional>
#include <string>

#include "franka/exception.h"
#include "law.h"

namespace franka {

class Duration {
 public:
  explicit Duration(uint64_t milliseconds = 0) noexcept : ms_(milliseconds) {}
  double toSec() const noexcept { return 1e-3 * static_cast<double>(ms_); }

 private:
  uint64_t ms_;
};

struct RobotState {
  std::array<double, 7> q{}, q_d{}, dq_d{}, ddq_d{};
  Duration time;
};

struct Finishable {
  bool motion_finished = false;
};

class JointVelocities : public Finishable {
 public:
  JointVelocities(const std::array<double, 7> &joint_velocities) noexcept : dq(joint_velocities) {}
  std::array<double, 7> dq{};
};

enum class RealtimeConfig { kEnforce, kIgnore };
enum class ControllerMode { kJointImpedance, kCartesianImpedance };
constexpr double kDefaultCutoffFrequency = 100.0;

class Robot {
 public:
  explicit Robot(const std::string &address, RealtimeConfig = RealtimeConfig::kEnforce) {
    const std::string prefix = "lossy:";
    is_lossy_ = address.rfind(prefix, 0) == 0;
    file_.open(is_lossy_ ? address.substr(prefix.size()) : address);
    if (!file_) {
      throw NetworkException("no connection");
    }
    file_.precision(17);
    for (int i = 0; i < 7; ++i) {
      state_.q[i] = state_.q_d[i] = law_initial.commanded[i];
    }
    is_blocked_ = address.find("blocked") != std::string::npos;
  }

  RobotState readOnce() { return state_; }

  void control(std::function<JointVelocities(const RobotState &, Duration)> callback,
               ControllerMode = ControllerMode::kJointImpedance, bool limit_rate = false,
               double cutoff_frequency = kDefaultCutoffFrequency) {
    if (limit_rate || cutoff_frequency < 1000.0) {
      throw ControlException("the commands would be altered");
    }
    uint64_t passed = 0;
    for (int cycle = 0; cycle < 100000; ++cycle) {
      const JointVelocities command = callback(state_, Duration(passed));
      for (int i = 0; i < 7; ++i) {
        state_.ddq_d[i] = (command.dq[i] - state_.dq_d[i]) / 1e-3;
      }
      advance();
      passed = 1;
      if (command.motion_finished) {
        return;
      }
      for (int lost = 0; is_lossy_ && cycle == 1000 && lost < 3; ++lost) {
        advance();
        ++passed;
      }
    }
    throw ControlException("the motion does not end");
  }

 private:
  void advance() {
    for (int i = 0; i < 7; ++i) {
      state_.dq_d[i] += 1e-3 * state_.ddq_d[i];
      state_.q_d[i] += 1e-3 * state_.dq_d[i];
      state_.q[i] = is_blocked_ ? state_.q[i] : state_.q_d[i];
      file_ << state_.dq_d[i] << (i < 6 ? ' ' : '\n');
    }
  }

  bool is_lossy_ = false, is_blocked_ = false;
  std::ofstream file_;
  RobotState state_;
};

}  // namespace franka
