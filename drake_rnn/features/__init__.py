"""Features: what an experiment may have besides a law, an arm and a path."""
