"""Validated arguments, error messages for invalid ones, and YAML documents."""
