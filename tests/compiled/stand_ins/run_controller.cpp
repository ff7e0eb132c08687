// Runs the controller of examples/ros2_control on an arm that follows its velocities, and prints
// them, a line each cycle, until they have been zero for a while at the end.
//
//   run_controller SECONDS LOST JOINTS...
//
// LOST cycles pass without an update after the first second; the arm keeps its velocity in them.
#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>

#include "controller_interface/controller_interface.hpp"
#include "law.h"

extern "C" controller_interface::ControllerInterface *make_plugin();

using controller_interface::CallbackReturn;

int main(int argc, char **argv) {
  std::unique_ptr<controller_interface::ControllerInterface> controller(make_plugin());
  const rclcpp_lifecycle::State state;
  const double duration = std::atof(argv[1]);
  const int lost = std::atoi(argv[2]);
  if (controller->on_init() != CallbackReturn::SUCCESS) return 3;
  auto &values = controller->get_node()->values;
  values["duration"] = duration;
  values["joints"] = std::vector<std::string>(argv + 3, argv + argc);
  if (controller->on_configure(state) != CallbackReturn::SUCCESS) return 4;
  const auto names = controller->command_interface_configuration().names;
  if (names.size() != LAW_JOINTS || names[0] != std::string(argv[3]) + "/velocity") return 5;
  std::array<double, LAW_JOINTS> q, v{};
  std::copy_n(law_initial.commanded, LAW_JOINTS, q.begin());
  std::vector<hardware_interface::LoanedCommandInterface> commands;
  std::vector<hardware_interface::LoanedStateInterface> states;
  for (int i = 0; i < LAW_JOINTS; ++i) {
    commands.emplace_back(&v[i]);
    states.emplace_back(&q[i]);
  }
  controller->assign_interfaces(std::move(commands), std::move(states));
  if (controller->on_activate(state) != CallbackReturn::SUCCESS) return 6;
  int passed = 1;
  for (int cycle = 0; cycle < 1000 * (duration + 3.0); ++cycle) {
    const rclcpp::Duration period(0, 1000000u * static_cast<unsigned>(passed));
    if (controller->update(rclcpp::Time(), period) != controller_interface::return_type::OK)
      return 7;
    passed = cycle == 1000 ? 1 + lost : 1;
    for (int k = 0; k < passed; ++k) {
      for (int i = 0; i < LAW_JOINTS; ++i) {
        q[i] += LAW_PERIOD * v[i];
        std::printf("%.17g%c", v[i], i < LAW_JOINTS - 1 ? ' ' : '\n');
      }
    }
  }
  return controller->on_deactivate(state) == CallbackReturn::SUCCESS ? 0 : 8;
}
