"""Judges of Ultralytics (AGPL-3.0)."""
