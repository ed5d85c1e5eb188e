"""Gymnasium environment of the rover's task."""
