"""From a recorded run to scores."""
