"""Recurrent-neural-network controllers for redundant manipulators, as Drake systems."""
