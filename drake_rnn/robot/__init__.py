"""The robot: its model, kinematics, limits, task and tool."""
