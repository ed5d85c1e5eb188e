"""Detectors of Ultralytics (AGPL-3.0)."""
