"""Drives of a rover: commands, rigid bodies on soil, traces and their metrics."""
