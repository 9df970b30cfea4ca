"""How a scene runs: engines, measures, environments."""
