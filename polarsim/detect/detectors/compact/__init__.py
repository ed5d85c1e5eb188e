"""Anchor-free detector `compact` in torch, under the licence of polarsim (BSD-3-Clause)."""
