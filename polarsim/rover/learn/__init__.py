"""The rover's task as an environment for learners, and policies to compare them with."""
