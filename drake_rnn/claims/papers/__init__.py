"""The papers' claims: for each paper a file of claims, and a module with measures."""
