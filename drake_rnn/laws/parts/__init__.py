"""What several laws are made of, one idea a file."""
