// A motion by a compiled law, cycle by cycle: what the loops of both examples share.
//
// The law is that of `drake-rnn compile adaptive_fr3 --to FOLDER`. Its arm must keep what is
// commanded from cycle to cycle. Nothing here allocates, locks or prints.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "law.h"

namespace compiled_motion {

constexpr int kJoints = LAW_JOINTS;
using Joints = std::array<double, kJoints>;

// The path of the experiment: a circle in the yz plane, from its first point [m, s].
constexpr std::array<double, 3> kFirstPoint{0.006890566592941183, 0.0, 0.7902820523028393};
constexpr double kRadius = 0.15, kTimeOfTurn = 3.0, kPi = 3.14159265358979323846;
// Time in which the reference slows down to rest [s].
constexpr double kSlowing = 1.0;
// Bounds of the stop, at most those of the README in FOLDER [rad/s^2, rad/s^3].
constexpr double kStopAcceleration = 9.99, kStopJerk = 4990.0;
// Farthest that a joint may be from the posture in which the experiment starts [rad].
constexpr double kFarthestStart = 0.01;
// Cycles of standstill that a motion begins and ends with.
constexpr int kStill = 25;

// What the robot does in a cycle in which it gets no command.
enum class Lost { keeps_velocity, keeps_acceleration };

class Motion {
 public:
  // The reference moves for `duration` [s], and then slows down within kSlowing.
  Motion(double duration, Lost lost) : duration_(duration), lost_(lost) {
    start(law_initial.commanded);
  }

  // Begin at rest at a position [rad]; false if it is not the one in which the experiment starts.
  bool start(const double *position) {
    state_ = law_initial;
    velocity_ = acceleration_ = Joints{};
    cycles_ = still_ = 0;
    stopping_ = failed_ = false;
    bool is_near = true;
    for (int i = 0; i < kJoints; ++i) {
      is_near = is_near && std::fabs(position[i] - law_initial.commanded[i]) <= kFarthestStart;
      state_.commanded[i] = position[i];
    }
    return is_near;
  }

  // Velocities for the next cycle [rad/s], given positions [rad] and the cycles lost since the last.
  // As in the project's own drive, a step of the fastest stop follows on cycles that were lost.
  const Joints &step(const double *position, int lost_cycles) {
    if (cycles_ < kStill && !stopping_) {
      ++cycles_;
      return velocity_;
    }
    if (lost_cycles > 0) {
      lose(lost_cycles);
    }
    cycles_ += 1 + lost_cycles;
    if (stopping_ || lost_cycles > 0 || !advance(position)) {
      brake();
    }
    const bool moves = std::any_of(velocity_.begin(), velocity_.end(),
                                   [](double v) { return std::fabs(v) > 0.0; });
    still_ = stopping_ && !moves ? still_ + 1 : 0;
    return velocity_;
  }

  // Bring the arm to rest from now on.
  void stop() { stopping_ = true; }
  // Whether the arm has been at rest, at the end, for kStill cycles.
  bool is_over() const { return still_ > kStill; }
  // Whether the law gave what is not finite, so that the arm was stopped.
  bool has_failed() const { return failed_; }
  const double *commanded() const { return state_.commanded; }

 private:
  // The point of the path that is reached at a time after the law's first cycle.
  void reference(double t, double *point) const {
    const double u = std::min(std::max((t - duration_) / kSlowing, 0.0), 1.0);
    const double along =
        std::min(t, duration_) + kSlowing * (u - u * u * u * u * (2.5 - 3.0 * u + u * u));
    const double phase = 2.0 * kPi * along / kTimeOfTurn;
    point[0] = kFirstPoint[0];
    point[1] = kFirstPoint[1] + kRadius * (std::cos(phase) - 1.0);
    point[2] = kFirstPoint[2] + kRadius * std::sin(phase);
  }

  // Take a step of the law; false if the arm must be stopped instead.
  bool advance(const double *position) {
    const double t = LAW_PERIOD * (cycles_ - kStill - 1);
    if (t >= duration_ + kSlowing) {
      stopping_ = true;
      return false;
    }
    law_signals signals;
    law_output out;
    std::copy(position, position + kJoints, signals.position);
    reference(t, signals.p_WE_desired);
    reference(t + LAW_PERIOD, signals.p_preview);
    if (law_step(&state_, &signals, &out) != 0) {
      stopping_ = failed_ = true;
      return false;
    }
    state_ = out.state;
    std::copy(out.velocity, out.velocity + kJoints, velocity_.begin());
    std::copy(state_.a, state_.a + kJoints, acceleration_.begin());
    return true;
  }

  // Go on as the robot has in cycles that it has lost.
  void lose(int count) {
    for (int i = 0; i < kJoints; ++i) {
      if (lost_ == Lost::keeps_velocity) {
        acceleration_[i] = 0.0;
      }
      for (int k = 0; k < count; ++k) {
        velocity_[i] += LAW_PERIOD * acceleration_[i];
        state_.commanded[i] += LAW_PERIOD * velocity_[i];
      }
    }
  }

  // Take a step of a stop within kStopAcceleration and kStopJerk; the law's state follows.
  void brake() {
    constexpr double h = LAW_PERIOD, change = kStopJerk * h;
    for (int i = 0; i < kJoints; ++i) {
      const double speed = std::fabs(velocity_[i]);
      // The deceleration d from which steps of the jerk lead to zero where the velocity does:
      // d^2 / (2 j) + h d / 2 = v, and no more than ends it in this cycle.
      const double ramp = kStopJerk * (std::sqrt(0.25 * h * h + 2.0 * speed / kStopJerk) - 0.5 * h);
      const double most = std::min({ramp, kStopAcceleration, speed / h});
      const double wanted = std::copysign(most, -velocity_[i]);
      const double before = acceleration_[i];
      const double after = std::min(std::max(wanted, before - change), before + change);
      const double v = velocity_[i] + h * after;
      velocity_[i] = std::fabs(v) < 1e-12 ? 0.0 : v;
      acceleration_[i] = after;
      state_.commanded[i] += h * velocity_[i];
      state_.v[i] = velocity_[i];
      state_.a[i] = acceleration_[i];
    }
  }

  double duration_;
  Lost lost_;
  law_state state_{};
  Joints velocity_{}, acceleration_{};
  int cycles_ = 0, still_ = 0;
  bool stopping_ = false, failed_ = false;
};

}  // namespace compiled_motion
