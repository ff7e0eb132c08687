// An FR3 moved by a compiled law in libfranka's own loop, at 1 kHz.
//
//   compiled_franka ADDRESS [SECONDS]
//
// The robot must stand in the posture in which the experiment starts. Keep the stop button at hand.
#include <cmath>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <iostream>

#include <franka/exception.h>
#include <franka/lowpass_filter.h>
#include <franka/robot.h>

#include "compiled_motion.hpp"

static_assert(LAW_JOINTS == 7, "an FR3 has seven joints");

namespace {

// Farthest that a joint may be from what is commanded, before the robot is stopped [rad].
constexpr double kFarthest = 0.05;

// Called in each cycle: no heap, no locks, no printing.
franka::JointVelocities answer(compiled_motion::Motion &motion, const franka::RobotState &state,
                               franka::Duration passed) {
  // Zero in the first cycle, one period after that; more where cycles were lost.
  const int lost = static_cast<int>(std::lround(passed.toSec() / LAW_PERIOD)) - 1;
  for (int i = 0; i < LAW_JOINTS; ++i) {
    if (!(std::fabs(state.q[i] - state.q_d[i]) <= kFarthest)) {
      motion.stop();
    }
  }
  franka::JointVelocities velocities(motion.step(state.q_d.data(), lost > 0 ? lost : 0));
  velocities.motion_finished = motion.is_over();
  return velocities;
}

}  // namespace

int main(int argc, char **argv) {
  const double duration = argc > 2 ? std::atof(argv[2]) : 6.0;
  if (argc < 2 || argc > 3 || !(duration > 0.0 && duration <= 3600.0)) {
    std::cerr << "usage: compiled_franka ADDRESS [SECONDS, at most 3600]\n";
    return 2;
  }
  try {
    // As in the project's own drive: without a real-time kernel it goes on, at the risk of cycles
    // that are lost.
    const bool is_realtime = std::ifstream("/sys/kernel/realtime").good();
    franka::Robot robot(argv[1], is_realtime ? franka::RealtimeConfig::kEnforce
                                             : franka::RealtimeConfig::kIgnore);
    compiled_motion::Motion motion(duration, compiled_motion::Lost::keeps_acceleration);
    if (!motion.start(robot.readOnce().q_d.data())) {
      std::cerr << "the robot is not where the experiment starts; move it first to";
      for (double q : law_initial.commanded) {
        std::cerr << ' ' << q;
      }
      std::cerr << " rad\n";
      return 1;
    }
    // The law keeps the robot's limits itself; a filter or a rate limit would alter its commands.
    robot.control(
        [&motion](const franka::RobotState &state, franka::Duration passed) {
          return answer(motion, state, passed);
        },
        franka::ControllerMode::kJointImpedance, false, franka::kMaxCutoffFrequency);
    if (motion.has_failed()) {
      std::cerr << "the law gave what is not finite; the robot was stopped\n";
      return 1;
    }
  } catch (const std::exception &error) {
    std::cerr << error.what() << '\n';
    return 1;
  }
  return 0;
}
