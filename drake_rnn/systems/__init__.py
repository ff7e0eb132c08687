"""The blocks that diagrams are made of, one a file."""
