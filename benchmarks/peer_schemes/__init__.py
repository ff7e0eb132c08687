"""What other libraries and our laws make of the same tasks; `benchmarks/peers.py` compares them."""
