"""Arguments that check themselves, what is said of bad ones, and YAML documents."""
