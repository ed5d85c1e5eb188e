"""A rover that drives: commands, rigid bodies on the soil, the trace that it leaves, and the figures of that."""
