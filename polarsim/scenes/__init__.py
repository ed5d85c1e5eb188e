"""Randomised training scenes: rocks of one terrain on generated sand, rendered with exact labels."""
