"""Entry point of ``python -m drake_rnn``."""

from .cli import main

if __name__ == "__main__":
    main()
