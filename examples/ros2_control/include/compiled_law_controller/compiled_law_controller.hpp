// A ros2_control controller: velocities of an arm's joints by a compiled law.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "compiled_motion.hpp"
#include "controller_interface/controller_interface.hpp"

namespace compiled_law_controller {

class CompiledLawController : public controller_interface::ControllerInterface {
 public:
  controller_interface::CallbackReturn on_init() override;
  controller_interface::InterfaceConfiguration command_interface_configuration() const override;
  controller_interface::InterfaceConfiguration state_interface_configuration() const override;
  controller_interface::CallbackReturn on_configure(const rclcpp_lifecycle::State &) override;
  controller_interface::CallbackReturn on_activate(const rclcpp_lifecycle::State &) override;
  controller_interface::CallbackReturn on_deactivate(const rclcpp_lifecycle::State &) override;
  // Called in each cycle: no heap, no locks, no printing.
  controller_interface::return_type update(const rclcpp::Time &, const rclcpp::Duration &) override;

 private:
  controller_interface::InterfaceConfiguration interfaces(const std::string &kind) const;
  bool read_positions();
  bool command(const compiled_motion::Joints &velocity);

  std::vector<std::string> joints_;
  compiled_motion::Joints position_{};
  std::optional<compiled_motion::Motion> motion_;
};

}  // namespace compiled_law_controller
