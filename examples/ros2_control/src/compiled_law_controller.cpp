#include "compiled_law_controller/compiled_law_controller.hpp"

#include <algorithm>
#include <cmath>
#include <exception>

#include "pluginlib/class_list_macros.hpp"
#include "rclcpp/logging.hpp"

namespace compiled_law_controller {

using controller_interface::CallbackReturn;
using controller_interface::InterfaceConfiguration;
using controller_interface::return_type;

CallbackReturn CompiledLawController::on_init() {
  try {
    auto_declare<std::vector<std::string>>("joints", {});
    auto_declare<double>("duration", 6.0);
  } catch (const std::exception &error) {
    RCLCPP_ERROR(get_node()->get_logger(), "%s", error.what());
    return CallbackReturn::ERROR;
  }
  return CallbackReturn::SUCCESS;
}

InterfaceConfiguration CompiledLawController::interfaces(const std::string &kind) const {
  InterfaceConfiguration configuration;
  configuration.type = controller_interface::interface_configuration_type::INDIVIDUAL;
  for (const std::string &joint : joints_) {
    configuration.names.push_back(joint + "/" + kind);
  }
  return configuration;
}

InterfaceConfiguration CompiledLawController::command_interface_configuration() const {
  return interfaces("velocity");
}

InterfaceConfiguration CompiledLawController::state_interface_configuration() const {
  return interfaces("position");
}

CallbackReturn CompiledLawController::on_configure(const rclcpp_lifecycle::State &) {
  const auto logger = get_node()->get_logger();
  joints_ = get_node()->get_parameter("joints").as_string_array();
  const double duration = get_node()->get_parameter("duration").as_double();
  if (joints_.size() != LAW_JOINTS) {
    RCLCPP_ERROR(logger, "joints: the law has %d, in the order of law.h", LAW_JOINTS);
    return CallbackReturn::ERROR;
  }
  for (std::size_t i = 0; i < LAW_JOINTS; ++i) {
    // A robot's own names may be others; those of the law must be in its order.
    const auto *place = std::find(law_joints, law_joints + LAW_JOINTS, joints_[i]);
    if (place != law_joints + LAW_JOINTS && place != law_joints + i) {
      RCLCPP_ERROR(logger, "joints: %s is number %d of the law, and %d here", joints_[i].c_str(),
                   static_cast<int>(place - law_joints) + 1, static_cast<int>(i) + 1);
      return CallbackReturn::ERROR;
    }
  }
  if (!(duration > 0.0 && duration <= 3600.0)) {
    RCLCPP_ERROR(logger, "duration: must be in (0, 3600] s");
    return CallbackReturn::ERROR;
  }
  const long rate = std::lround(1.0 / LAW_PERIOD);
  if (static_cast<long>(get_update_rate()) != rate || is_async()) {
    RCLCPP_ERROR(logger, "update_rate: the law needs %ld Hz, in the loop of the manager", rate);
    return CallbackReturn::ERROR;
  }
  motion_.emplace(duration, compiled_motion::Lost::keeps_velocity);
  return CallbackReturn::SUCCESS;
}

CallbackReturn CompiledLawController::on_activate(const rclcpp_lifecycle::State &) {
  if (!read_positions() || !motion_->start(position_.data())) {
    RCLCPP_ERROR(get_node()->get_logger(), "the arm is not where the experiment starts");
    return CallbackReturn::ERROR;
  }
  return CallbackReturn::SUCCESS;
}

CallbackReturn CompiledLawController::on_deactivate(const rclcpp_lifecycle::State &) {
  // The manager makes no more cycles: whatever still moves is left to the hardware's own stop.
  command(compiled_motion::Joints{});
  return CallbackReturn::SUCCESS;
}

return_type CompiledLawController::update(const rclcpp::Time &, const rclcpp::Duration &period) {
  const int lost = static_cast<int>(std::lround(period.seconds() / LAW_PERIOD)) - 1;
  if (!read_positions()) {
    // The law may as well be told what was commanded.
    std::copy_n(motion_->commanded(), LAW_JOINTS, position_.begin());
  }
  const bool is_taken = command(motion_->step(position_.data(), std::max(lost, 0)));
  if (!is_taken) {
    motion_->stop();
  }
  // After a failure the arm is brought to rest first.
  return motion_->has_failed() && motion_->is_over() ? return_type::ERROR : return_type::OK;
}

bool CompiledLawController::read_positions() {
  for (std::size_t i = 0; i < LAW_JOINTS; ++i) {
    const std::optional<double> value = state_interfaces_[i].get_optional();
    if (!value.has_value() || !std::isfinite(*value)) {
      return false;
    }
    position_[i] = *value;
  }
  return true;
}

bool CompiledLawController::command(const compiled_motion::Joints &velocity) {
  bool is_taken = true;
  for (std::size_t i = 0; i < LAW_JOINTS; ++i) {
    is_taken = command_interfaces_[i].set_value(velocity[i]) && is_taken;
  }
  return is_taken;
}

}  // namespace compiled_law_controller

PLUGINLIB_EXPORT_CLASS(compiled_law_controller::CompiledLawController,
                       controller_interface::ControllerInterface)
