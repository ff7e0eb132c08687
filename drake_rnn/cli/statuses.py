"""Exit statuses of commands; 0 is that of success."""

#: A run failed; the input is bad; a bound that was to be checked is broken.
FAILED, BAD_INPUT, NOT_MET = 1, 2, 3
#: The command was told to end before it was done.
INTERRUPTED = 130
