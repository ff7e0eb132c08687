// Stand-in for what examples/ros2_control uses of ros2_control 6.8 and rclcpp: the same names and
// types.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "rclcpp/logging.hpp"

namespace rclcpp {

class Time {};

class Duration {
 public:
  Duration(int32_t seconds, uint32_t nanoseconds) : seconds_(seconds + 1e-9 * nanoseconds) {}
  double seconds() const { return seconds_; }

 private:
  double seconds_;
};

using Value = std::variant<double, std::vector<std::string>>;

class Parameter {
 public:
  explicit Parameter(Value value) : value_(std::move(value)) {}
  double as_double() const { return std::get<double>(value_); }
  std::vector<std::string> as_string_array() const {
    return std::get<std::vector<std::string>>(value_);
  }

 private:
  Value value_;
};

}  // namespace rclcpp

namespace rclcpp_lifecycle {

class State {};

class LifecycleNode {
 public:
  rclcpp::Logger get_logger() const { return {}; }
  rclcpp::Parameter get_parameter(const std::string &name) const {
    return rclcpp::Parameter(values.at(name));
  }
  std::map<std::string, rclcpp::Value> values;
};

}  // namespace rclcpp_lifecycle

namespace hardware_interface {

class LoanedStateInterface {
 public:
  explicit LoanedStateInterface(const double *value) : value_(value) {}
  LoanedStateInterface(LoanedStateInterface &&) = default;
  template <typename T = double>
  [[nodiscard]] std::optional<T> get_optional(unsigned int = 10) const {
    return *value_;
  }

 private:
  const double *value_;
};

class LoanedCommandInterface {
 public:
  explicit LoanedCommandInterface(double *value) : value_(value) {}
  LoanedCommandInterface(LoanedCommandInterface &&) = default;
  template <typename T>
  [[nodiscard]] bool set_value(const T &value, unsigned int = 10) {
    *value_ = value;
    return true;
  }

 private:
  double *value_;
};

}  // namespace hardware_interface

namespace controller_interface {

enum class CallbackReturn : uint8_t { SUCCESS = 97, FAILURE = 98, ERROR = 99 };
enum class return_type : uint8_t { OK = 0, ERROR = 1 };
enum class interface_configuration_type : uint8_t { ALL = 0, INDIVIDUAL = 1, NONE = 2 };

struct InterfaceConfiguration {
  interface_configuration_type type = interface_configuration_type::NONE;
  std::vector<std::string> names = {};
};

class ControllerInterface {
 public:
  virtual ~ControllerInterface() = default;
  virtual InterfaceConfiguration command_interface_configuration() const = 0;
  virtual InterfaceConfiguration state_interface_configuration() const = 0;
  virtual CallbackReturn on_init() = 0;
  virtual CallbackReturn on_configure(const rclcpp_lifecycle::State &) = 0;
  virtual CallbackReturn on_activate(const rclcpp_lifecycle::State &) = 0;
  virtual CallbackReturn on_deactivate(const rclcpp_lifecycle::State &) = 0;
  virtual return_type update(const rclcpp::Time &, const rclcpp::Duration &) = 0;

  void assign_interfaces(std::vector<hardware_interface::LoanedCommandInterface> &&commands,
                         std::vector<hardware_interface::LoanedStateInterface> &&states) {
    command_interfaces_ = std::move(commands);
    state_interfaces_ = std::move(states);
  }
  std::shared_ptr<rclcpp_lifecycle::LifecycleNode> get_node() { return node_; }
  unsigned int get_update_rate() const { return 1000; }
  bool is_async() const { return false; }

 protected:
  template <typename T>
  T auto_declare(const std::string &name, const T &default_value) {
    return std::get<T>(node_->values.emplace(name, default_value).first->second);
  }

  std::vector<hardware_interface::LoanedCommandInterface> command_interfaces_;
  std::vector<hardware_interface::LoanedStateInterface> state_interfaces_;

 private:
  std::shared_ptr<rclcpp_lifecycle::LifecycleNode> node_ =
      std::make_shared<rclcpp_lifecycle::LifecycleNode>();
};

}  // namespace controller_interface
