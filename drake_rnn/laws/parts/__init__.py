"""Building blocks shared by the laws, one idea per file."""
