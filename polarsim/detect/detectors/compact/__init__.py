"""The detector `compact`: an anchor-free detector in plain torch, under polarsim's own licence."""
