"""What lets algebra be written once for NumPy's arrays and JAX's."""
